"""The record of the motors that a daemon drives, in a file beside its socket.

It names drivers and buses, so perhaps code to import; root asks who owns the file before it runs that.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from wayfarer.daemon.socket import paths
from wayfarer.errors import BadInput
from wayfarer.files import write_atomically

NAME = "motors.json"
MAX_BYTES = 65_536


class DrivenBoard(NamedTuple):
    """A board: the table ``[parts.motors]`` of a rover file, unchanged, and the name of its buses."""

    motors: dict[str, Any]
    buses: str

    @property
    def names_code(self) -> bool:
        """Whether it names a function to import, and not only drivers and buses that are installed."""
        return ":" in self.motors["driver"] or ":" in self.buses


def write_record(socket_path: Path, driven: DrivenBoard) -> None:
    """Write the record of a daemon that holds ``paths.single_daemon`` for this socket.

    It replaces the record of a killed daemon.

    Raises:
        BadInput: it cannot be written.
    """
    path = socket_path.with_name(NAME)
    try:
        write_atomically(path, json.dumps(driven._asdict()), mode=0o600)
    except OSError as error:
        raise BadInput(f"{path}: the record of the motors cannot be written: {error.strerror}") from None


def remove_record(socket_path: Path) -> None:
    """Remove the record: the wheels are stopped, and no daemon drives them."""
    with suppress(OSError):
        socket_path.with_name(NAME).unlink(missing_ok=True)


def known_records() -> Iterator[Path]:
    """Give every path where a daemon may have left its record, each once; ``read_record`` judges each."""
    return (folder / NAME for folder in dict.fromkeys(paths.known_folders()))


def read_record(path: Path) -> tuple[DrivenBoard, os.stat_result] | None:
    """Return what a daemon recorded, and whose file it is; None if there is none, or none that this user may read.

    Raises:
        BadInput: no daemon wrote this; the text names the file.
    """
    try:
        # A symlink is not followed, and a pipe that nobody writes to does not block this.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
            about, text = os.fstat(file.fileno()), file.read(MAX_BYTES)
        driven = DrivenBoard(**json.loads(text))
        if not isinstance(driven.motors["driver"], str) or not isinstance(driven.buses, str):
            raise TypeError
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return None
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        raise BadInput(f"{path}: rejected: no daemon wrote this; remove it") from None
    return driven, about
