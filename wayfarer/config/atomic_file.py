"""Atomic file writes: after a power cut the file is complete or unchanged."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from wayfarer.errors import BadInput


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Give the path of a draft to write; once that is done and on the disk, the draft takes the place of the file.

    A symlink stays, and what it points to is replaced. Whatever fails, the draft goes and what was there stays.

    Raises:
        BadInput: what is there is no ordinary file; a device or a pipe would be lost.
        OSError: the file cannot be written.
    """
    target = Path(os.path.realpath(path))  # Path.resolve raises RuntimeError where symlinks go round in a circle
    if (path.exists() or os.path.lexists(target)) and not path.is_file():
        raise BadInput(f"{path} is no ordinary file and is left as it is: name another one")
    draft = target.with_name(f".{target.name}.{os.getpid()}.new")
    try:
        yield draft
        _sync(draft)
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
    target = Path(os.path.realpath(path))
    draft = target.with_name(f".{target.name}.{os.getpid()}.new")
    try:
        draft.mkdir()
        made = draft / target.name
        yield made
        for each in made.iterdir():
            _sync(each)
        made.replace(target)
        sync_folder(target.parent)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def write_atomically(path: Path, content: str | bytes, mode: int | None = None) -> None:
    """Write a file as ``atomic_file`` does; text in UTF-8, with the permissions ``mode`` or those that are usual."""
    with atomic_file(path) as draft:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)
        if mode is not None:
            draft.chmod(mode)


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
