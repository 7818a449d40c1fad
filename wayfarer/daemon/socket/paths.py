"""Path of the control socket, and the lock that allows only one daemon on it.

The daemon uses the first of these folders that it can use; the client tries all of them in this order:
``$RUNTIME_DIRECTORY`` (systemd sets it for services), ``/run/wayfarer``, ``$XDG_RUNTIME_DIR/wayfarer``,
``/tmp/wayfarer-<uid>``. Root's client also tries the daemons of users who are logged in, in ``/run/user``, because sudo
removes ``XDG_RUNTIME_DIR``.

Another user who can write to such a folder could put a false daemon there, which answers that it has stopped. So both
sides pass over a folder that is not safe, and the client asks the kernel who listens (``may_listen``).
"""

from __future__ import annotations

import fcntl
import os
import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from select import POLLRDHUP, poll
from stat import S_IMODE, S_ISDIR, S_ISVTX
from typing import TYPE_CHECKING, Any, Final

from wayfarer.errors import BadInput, WayfarerError

if TYPE_CHECKING:
    from asyncio import BaseTransport  # the client does without a loop

SYSTEM_FOLDER = Path("/run/wayfarer")
SESSIONS_FOLDER = Path("/run/user")
SHARED_FOLDER = Path("/tmp")
SOCKET_NAME = "control.sock"
_PRIVATE = 0o700
OTHERS_WRITE = 0o022
_CREDENTIALS: Final = struct.Struct("iII")  # struct ucred of unix(7): process, user and group


class AlreadyRunning(WayfarerError):
    """Another daemon runs on this socket, and was left alone."""

    exit_code = 75  # EX_TEMPFAIL of sysexits.h


def daemon_socket() -> Path:
    """Return where a daemon makes its socket.

    Raises:
        BadInput: no folder is safe; the text names those that are not.
    """
    for folder in _own_folders():
        if _why_unsafe(folder) is None and (folder != SYSTEM_FOLDER or _writable(SYSTEM_FOLDER)):
            return folder / SOCKET_NAME
    raise BadInput("no folder for the control socket: " + "; ".join(unsafe_folders()))


def known_sockets() -> Iterator[Path]:
    """Give every place where a daemon's socket may be, in the order of preference; unsafe folders are left out."""
    return (folder / SOCKET_NAME for folder in known_folders() if _why_unsafe(folder) is None)


def unsafe_folders() -> list[str]:
    """Return a sentence for each folder that is left out: which, why, and what to do."""
    return [f"{folder}: {why}" for folder in known_folders() if (why := _why_unsafe(folder))]


def may_listen(uid: int, socket_path: Path) -> bool:
    """Return whether the process that listens at a socket may be this user's daemon, or one that this user may ask.

    Folders in ``/run`` are made by root, so their owner is believed; elsewhere only root and this user are.
    """
    owners = {0, os.geteuid()}
    if _is_roots(folder := socket_path.parent):
        with suppress(OSError):
            owners.add(folder.lstat().st_uid)
    return uid in owners


def peer_uid(connection: Any) -> int:
    """Return the user at the other end: of the process that connected or, asked by a client, that began to listen."""
    _, user, _ = _CREDENTIALS.unpack(connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
    return int(user)


def has_gone(transport: BaseTransport | None) -> bool:
    """Return whether who is at the other end has closed its side, also where what it sent before was not read yet."""
    if transport is None or transport.is_closing():
        return True
    ends = poll()
    ends.register(transport.get_extra_info("socket"), POLLRDHUP)
    return bool(ends.poll(0))


def known_folders() -> Iterator[Path]:
    """Give every folder where a daemon may be or have been, in the order of preference, also unsafe ones."""
    yield from _own_folders()
    if os.geteuid() == 0:
        # The session of who gave sudo comes first: the daemon of another user is hardly the one that is meant.
        sudo = os.environ.get("SUDO_UID", "")
        yield from sorted(SESSIONS_FOLDER.glob("*/wayfarer"), key=lambda folder: (folder.parent.name != sudo, folder))


def _own_folders() -> Iterator[Path]:
    if services := os.environ.get("RUNTIME_DIRECTORY"):
        yield Path(services.split(":")[0])
    yield SYSTEM_FOLDER
    sessions = Path(os.environ.get("XDG_RUNTIME_DIR") or "nowhere")
    if sessions.is_absolute() and os.access(sessions, os.F_OK) and sessions.is_dir():  # is_dir() raises at long names
        yield sessions / "wayfarer"
    yield SHARED_FOLDER / f"wayfarer-{os.geteuid()}"


def _is_roots(folder: Path) -> bool:
    """Return whether only root can have put a folder, or the session's folder that it is in, at this path."""
    return folder.parent == SYSTEM_FOLDER.parent or SESSIONS_FOLDER in folder.parents


def _writable(folder: Path) -> bool:
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


def _why_unsafe(folder: Path) -> str | None:
    """Return why a folder cannot have this user's socket; None for a safe one, and for one that is not there."""
    try:
        parent_mode, found = folder.parent.stat().st_mode, folder.lstat()
    except OSError:
        return None
    mode = S_IMODE(found.st_mode)
    if not S_ISDIR(found.st_mode):
        return "is no folder; remove it"
    if _is_roots(folder):
        return f"others may write to it (mode {mode:04o})" if mode & OTHERS_WRITE else None
    if parent_mode & OTHERS_WRITE and not parent_mode & S_ISVTX:
        return f"others may put another folder in its place, because {folder.parent} is open to them and not sticky"
    if found.st_uid == os.geteuid() and mode & 0o777 == _PRIVATE:  # one made in a set-group-ID folder has that bit too
        return None
    return (
        f"must be a folder that only user {os.geteuid()} can enter (mode 0700), but it belongs to user"
        f" {found.st_uid} with mode {mode:04o}: somebody may be listening in; remove it"
    )


@contextmanager
def single_daemon(socket_path: Path) -> Iterator[None]:
    """Hold the lock of a socket while entered; only the holder may remove the socket's file.

    The lock is the kernel's (flock on ``<socket>.lock``), so it ends with the process in every case, and the next
    daemon removes the socket of a killed one. The lock's file stays: if it were removed, two processes could hold locks
    on two files of the same name.

    Raises:
        AlreadyRunning: another process holds it; the text names its process id.
        BadInput: the folder or the lock cannot be made, or something else is at the path of the socket.
    """
    lock_path = socket_path.with_name(f"{socket_path.name}.lock")
    try:
        socket_path.parent.mkdir(mode=_PRIVATE, parents=True, exist_ok=True)
        lock = os.open(lock_path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
    except OSError as error:
        raise BadInput(f"{lock_path}: the daemon's lock cannot be made: {error.strerror}") from None
    if why := _why_unsafe(socket_path.parent):  # asked again: somebody may have made it just before
        os.close(lock)
        raise BadInput(f"{socket_path.parent}: {why}")
    try:
        _take(lock, socket_path)
        _remove(socket_path)
        try:
            yield
        finally:
            socket_path.unlink(missing_ok=True)
            os.ftruncate(lock, 0)
    finally:
        os.close(lock)


def _take(lock: int, socket_path: Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(lock, 20, 0).decode("ascii", "replace").strip() or "not known yet"
        raise AlreadyRunning(
            f"a wayfarer daemon is running already (process {holder}, socket {socket_path}): talk to it with"
            " 'wayfarer status', or end it with 'wayfarer stop'"
        ) from None
    os.ftruncate(lock, 0)
    os.pwrite(lock, f"{os.getpid()}\n".encode(), 0)


def _remove(socket_path: Path) -> None:
    """Remove what a killed daemon has left at the socket's path."""
    try:
        socket_path.unlink(missing_ok=True)
    except OSError as error:
        what = "it is a folder" if socket_path.is_dir() else error.strerror
        raise BadInput(
            f"{socket_path}: the control socket cannot be made: {what}; remove what is at that path"
        ) from None
