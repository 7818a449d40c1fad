"""The computer's own health: what a Raspberry Pi says, and what another computer does not."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from wayfarer.checks.system import THROTTLED
from wayfarer.daemon import computer
from wayfarer.daemon.computer import CPU_TEMPERATURE, ComputerWatch, Health, health


def write(root: Path, path: str, text: str) -> None:
    (root / path.lstrip("/")).parent.mkdir(parents=True, exist_ok=True)
    (root / path.lstrip("/")).write_text(text)


def test_a_pi_tells_of_heat_and_power(tmp_path: Path) -> None:
    write(tmp_path, CPU_TEMPERATURE, "61341\n")
    write(tmp_path, THROTTLED, "50005\n")
    found = health(tmp_path, tmp_path)
    assert (found["cpu_c"], found["throttled"]) == (61.341, "50005")
    assert isinstance(found["disk_free_mb"], float)


@pytest.mark.parametrize("text", ["", "hot", "\xff"])
def test_what_is_not_told_is_none(tmp_path: Path, text: str) -> None:
    write(tmp_path, CPU_TEMPERATURE, text)
    found = health(tmp_path / "gone", tmp_path)
    assert (found["cpu_c"], found["throttled"], found["disk_free_mb"]) == (None, None, None)


def test_watch_tells_at_once_and_ends_when_it_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(computer, "EVERY_S", 0.01)
    told, enough = [], threading.Event()

    def take(found: Health) -> None:
        told.append(found)
        if len(told) == 3:
            enough.set()
            raise RuntimeError("Event loop is closed")

    with ComputerWatch(tmp_path, take):
        assert enough.wait(5.0)
    thread = next((each for each in threading.enumerate() if each.name == "computer watch"), None)
    if thread is not None:
        thread.join(5.0)
        assert not thread.is_alive()
