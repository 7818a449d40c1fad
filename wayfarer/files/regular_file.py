"""Opens files that somebody else may have made: never waits, never reads more than a bound."""

from __future__ import annotations

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

# What is refused, for the person who finds it there.
_KINDS = {
    stat.S_IFIFO: "it is a pipe",
    stat.S_IFSOCK: "it is a socket",
    stat.S_IFCHR: "it is a device",
    stat.S_IFBLK: "it is a device",
    stat.S_IFLNK: "it is a symlink",
}


def open_regular(path: Path, buffering: int = -1) -> BinaryIO:
    """Open an ordinary file, or a symlink to one, for reading.

    A pipe would block its reader until somebody writes, and a device may give bytes for ever.

    Args:
        path: of the file.
        buffering: how much is read from the disk at once, in bytes; -1 is the usual.

    Raises:
        OSError: there is no such file, or it is no ordinary one; ``strerror`` says what it is.
    """
    # Asked first, because opening a device can have an effect: a serial port resets some motor boards.
    _refuse_special(path, path.stat().st_mode)
    return os.fdopen(_opened(path, os.O_RDONLY), "rb", buffering)


def open_to_append(path: Path) -> BinaryIO:
    """Open an ordinary file for reading and writing, one that a person has not named; make it if there is none.

    Raises:
        OSError: it is no ordinary file, or a symlink, which may point to any file; ``strerror`` says what it is.
    """
    with suppress(FileNotFoundError):
        _refuse_special(path, path.lstat().st_mode)
    return os.fdopen(_opened(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW), "r+b")


def read_regular(path: Path, most_bytes: int) -> bytes:
    """Return what is in an ordinary file.

    Raises:
        OSError: as of ``open_regular``, or the file has more than ``most_bytes``.
    """
    with open_regular(path) as file:
        content = file.read(most_bytes + 1) or b""  # None for a file of the kernel that would have to be waited for
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"it has more than {most_bytes:,} bytes", str(path))
    return content


def _opened(path: Path, flags: int) -> int:
    """Open a file, and ask again what it is, because another one may be there by now."""
    # O_NONBLOCK opens a pipe without waiting for its writer.
    descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_NOCTTY, 0o666)
    try:
        _refuse_special(path, os.fstat(descriptor).st_mode)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def _refuse_special(path: Path, mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, f"{_KINDS.get(stat.S_IFMT(mode), 'it is special')}, no ordinary file", str(path))
