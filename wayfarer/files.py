"""Files whose folder may belong to another user: read without waiting, written whole and not through a symlink.

Reading never waits, and never reads more than a bound. After a power cut a file that was written is complete or
unchanged: a draft is written and takes its place. The other user may have put a symlink where a file is to be written.
So a draft is a new file, which no symlink can be, and it replaces a symlink at the path, unless a person has given this
path.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from wayfarer.errors import BadInput

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
        OSError: there is no such file, or it is not an ordinary one; ``strerror`` says what it is.
    """
    # Asked first, because opening a device can have an effect: a serial port resets some motor boards.
    _refuse_special(path, path.stat().st_mode)
    return os.fdopen(_opened(path, os.O_RDONLY), "rb", buffering)


def open_to_append(path: Path) -> BinaryIO:
    """Open an ordinary file for reading and writing, one that a person has not named; make it if there is none.

    Raises:
        OSError: it is not an ordinary file, or a symlink, which may point to any file; ``strerror`` says what it is.
    """
    with suppress(FileNotFoundError):
        _refuse_special(path, path.lstat().st_mode)
    return os.fdopen(_opened(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW), "r+b")


def open_folder(path: Path) -> int:
    """Return the descriptor of a folder, which is made if it is not there; no symlink is followed on the way.

    Args:
        path: absolute.

    Raises:
        OSError: it cannot be opened, or a symlink is on the way.
    """
    step = os.O_PATH | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
    folder = os.open(path.anchor, step)
    try:
        for name in path.parts[1:]:
            try:
                inner = os.open(name, step, dir_fd=folder)
            except FileNotFoundError:
                os.mkdir(name, dir_fd=folder)
                inner = os.open(name, step, dir_fd=folder)
            os.close(folder)
            folder = inner
        return os.open(".", os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC, dir_fd=folder)
    finally:
        os.close(folder)


def read_regular(path: Path, most_bytes: int) -> bytes:
    """Return what is in an ordinary file.

    Raises:
        OSError: as of ``open_regular``, or the file has more than ``most_bytes``.
    """
    with open_regular(path) as file:
        return _bounded(file, path, most_bytes)


def _bounded(file: BinaryIO, path: Path, most_bytes: int) -> bytes:
    content = file.read(most_bytes + 1) or b""  # None for a file of the kernel that would have to be waited for
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"it has more than {most_bytes:,} bytes", str(path))
    return content


def read_own(path: Path, most_bytes: int) -> bytes:
    """Return what is in an ordinary file of this user or of root, one that a person has not named.

    Raises:
        OSError: as of ``read_regular``, or it is a symlink, or another user's.
    """
    _refuse_special(path, path.lstat().st_mode)
    with os.fdopen(_opened(path, os.O_RDONLY | os.O_NOFOLLOW), "rb") as file:
        if os.fstat(file.fileno()).st_uid not in {0, os.geteuid()}:
            raise OSError(errno.EPERM, "it is another user's file", str(path))
        return _bounded(file, path, most_bytes)


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


# -- writing ---------------------------------------------------------------------------------------------------------


@contextmanager
def atomic_file(path: Path, *, mode: int | None = None, follow_symlink: bool = False) -> Iterator[BinaryIO]:
    """Give an open draft to write (and read); when that is done and on the disk, it takes the place of the file.

    If anything fails, the draft is deleted and the old file stays.

    Args:
        path: of the file.
        mode: its permissions; without it the usual ones.
        follow_symlink: replace what a symlink points to, and not the symlink: only for a path that a person gave.

    Raises:
        BadInput: what is there is not an ordinary file; a device or a pipe would be lost.
        OSError: the file cannot be written.
    """
    # Path.resolve raises RuntimeError where symlinks go round in a circle.
    target = Path(os.path.realpath(path)) if follow_symlink else path
    replaceable = target.is_file() or (target.is_symlink() and not follow_symlink)
    if os.path.lexists(target) and not replaceable:
        raise BadInput(f"{path} is not an ordinary file and is left as it is: name another one")
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


def write_atomically(
    path: Path, content: str | bytes, *, mode: int | None = None, follow_symlink: bool = False
) -> None:
    """Write a file as ``atomic_file`` does; text in UTF-8."""
    with atomic_file(path, mode=mode, follow_symlink=follow_symlink) as draft:
        draft.write(content.encode() if isinstance(content, str) else content)


# What a disk without hard links says, such as a FAT stick: vfat, exFAT, FUSE.
_NO_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS)


def write_new(path: Path, content: str) -> None:
    """Write a file that is not there yet, as text in UTF-8; if anything fails, nothing is left.

    Raises:
        FileExistsError: something is there, also if it has come meanwhile.
        OSError: the file cannot be written.
    """
    draft = _draft(path)
    try:
        with draft.open("xb") as file:
            file.write(content.encode())
            file.flush()
            os.fsync(file.fileno())
        try:
            os.link(draft, path)  # which replaces nothing, as a rename would
        except OSError as error:
            if error.errno not in _NO_LINKS:
                raise
            path.touch(exist_ok=False)  # ours from now on, and the draft may replace it
            try:
                draft.replace(path)
            except BaseException:
                path.unlink(missing_ok=True)
                raise
    finally:
        draft.unlink(missing_ok=True)
    sync_folder(path.parent)


def _draft(target: Path) -> Path:
    """Return a name beside the file that nobody can have guessed and taken."""
    return target.with_name(f".{target.name}.{os.urandom(4).hex()}.new")


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
