"""Atomic file writes: after a power cut the file is complete or unchanged.

The folder may belong to another user, who may have put a symlink where a file is to be written. So a draft is a new
file, which no symlink can be, and it replaces a symlink at the path, unless a person has given this path.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from wayfarer.errors import BadInput


@contextmanager
def atomic_file(path: Path, *, mode: int | None = None, follow_symlink: bool = False) -> Iterator[BinaryIO]:
    """Give an open draft to write (and read); when that is done and on the disk, it takes the place of the file.

    Whatever fails, the draft goes and what was there stays.

    Args:
        path: of the file.
        mode: its permissions; without it the usual ones.
        follow_symlink: replace what a symlink points to, and not the symlink: only for a path that a person gave.

    Raises:
        BadInput: what is there is no ordinary file; a device or a pipe would be lost.
        OSError: the file cannot be written.
    """
    # Path.resolve raises RuntimeError where symlinks go round in a circle.
    target = Path(os.path.realpath(path)) if follow_symlink else path
    replaceable = target.is_file() or (target.is_symlink() and not follow_symlink)
    if os.path.lexists(target) and not replaceable:
        raise BadInput(f"{path} is no ordinary file and is left as it is: name another one")
    draft = _draft(target)
    try:
        # O_EXCL makes a new file and follows no symlink. One with a mode is its owner's only until it has that mode.
        flags, least = os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666 if mode is None else 0o600
        with os.fdopen(os.open(draft, flags, least), "w+b") as file:
            if mode is not None:
                os.fchmod(file.fileno(), mode)
            yield file
            file.flush()
            os.fsync(file.fileno())
        draft.replace(target)
        sync_folder(target.parent)
    except BaseException:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        raise


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Give the path of a folder to make, with the same name; once that is done and on the disk, it stands at ``path``.

    Whatever fails, the draft goes. A folder with files in it is never replaced.

    Raises:
        OSError: the folder cannot be written, or there is one already.
    """
    draft = _draft(path)
    try:
        draft.mkdir()
        made = draft / path.name
        yield made
        for each in made.iterdir():
            _sync(each)
        made.replace(path)
        sync_folder(path.parent)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def write_atomically(
    path: Path, content: str | bytes, *, mode: int | None = None, follow_symlink: bool = False
) -> None:
    """Write a file as ``atomic_file`` does; text in UTF-8."""
    with atomic_file(path, mode=mode, follow_symlink=follow_symlink) as draft:
        draft.write(content.encode() if isinstance(content, str) else content)


def _draft(target: Path) -> Path:
    """Return a name beside the file that nobody can have guessed and taken."""
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.new")


def _sync(path: Path) -> None:
    """Have the disk keep what a file or a folder contains."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_folder(folder: Path) -> None:
    """Have the disk keep the names of the files in a folder, if it may be read and its file system can do that."""
    with suppress(OSError):
        _sync(folder)
