"""The record of the motors that a daemon drives, in a file beside its socket.

The file names code to import (``driver``, ``buses``), so it is used only if nobody but its owner and root can have
written it: nobody else may write to it or to its folder, and the owner is this user or root. Root uses the file of any
owner, and must act with that owner's rights.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from stat import S_IMODE, S_ISREG
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


class FoundRecord(NamedTuple):
    """What a daemon recorded, and the user who owns the file."""

    driven: DrivenBoard
    owner: int


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


def read_record(path: Path) -> FoundRecord | None:
    """Return what a daemon recorded; None if there is no record, or none that this user may read.

    Raises:
        BadInput: the record cannot be trusted or understood; the text names the file and says why.
    """
    try:
        folder = os.open(path.parent, os.O_PATH | os.O_DIRECTORY)
    except OSError:
        return None
    try:
        return _read(path, folder)
    except (FileNotFoundError, PermissionError):
        return None
    except OSError as error:
        why = "is a symlink" if error.errno == errno.ELOOP else f"cannot be read: {error.strerror}"
        raise BadInput(f"{path}: rejected: it {why}") from None
    finally:
        os.close(folder)


def _read(path: Path, folder: int) -> FoundRecord | None:
    # A symlink is not followed, and a pipe that nobody writes to does not block this.
    file = os.open(path.name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
    with os.fdopen(file, "rb") as reader:
        about = os.fstat(file)
        if why := _why_untrusted(about, os.fstat(folder)):
            raise BadInput(f"{path}: rejected: {why}; remove it")
        text = reader.read(MAX_BYTES)
    try:
        fields = json.loads(text)
        driven = DrivenBoard(**fields)
        if not isinstance(driven.motors["driver"], str) or not isinstance(driven.buses, str):
            raise TypeError
    except (ValueError, TypeError, KeyError, RecursionError):
        raise BadInput(f"{path}: rejected: no daemon wrote this; remove it") from None
    return FoundRecord(driven, about.st_uid)


def _why_untrusted(file: os.stat_result, folder: os.stat_result) -> str | None:
    """Return why a file must not be trusted, or None."""
    user = os.geteuid()
    if not S_ISREG(file.st_mode):
        return "it is no ordinary file"
    for what, about in (("it", file), ("its folder", folder)):
        if about.st_mode & paths.OTHERS_WRITE:
            return f"others may write to {what} (mode {S_IMODE(about.st_mode):04o})"
    if user not in {0, file.st_uid} and file.st_uid != 0:
        return f"it belongs to user {file.st_uid}"
    if folder.st_uid not in {0, file.st_uid}:
        return f"its folder belongs to user {folder.st_uid}, and it to user {file.st_uid}"
    return None
