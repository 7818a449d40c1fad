"""Rover files as text: what loads, and what is said of one that does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.errors import BadConfig, BadInput

BODY = {"length_m": "0.4", "width_m": "0.4", "track_m": "0.5", "max_speed_m_s": "1.4"}


def rover_toml(top: str = "", rest: str = "", **body: str) -> str:
    """Return a rover file with other keys before, in and after its body; the body begins at line 3."""
    vehicle = "\n".join(f"{key} = {value}" for key, value in (BODY | body).items() if value)
    return f'name = "test"\n{top}\n[vehicle]\n{vehicle}\n{rest}\n'


def load(folder: Path, text: str | bytes) -> RoverConfig:
    """Load a rover from a file with this text."""
    path = folder / "rover.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load_rover(str(path))


def complaint(
    folder: Path,
    text: str | bytes,
    *,
    name: str = "rover.toml",
    read: Callable[[Path, str | bytes], object] = load,
    error: type[BadInput] = BadConfig,
) -> str:
    """Return what is said of a bad file, without its name; ``read`` writes the file and reads it."""
    with pytest.raises(error) as caught:
        read(folder, text)
    said = str(caught.value)
    assert "\n" not in said, "a complaint is one line"
    assert caught.value.exit_code == 2
    assert said.startswith(f"{folder}/{name}: ")
    return said.removeprefix(f"{folder}/{name}: ")
