"""Path of the control socket, and the lock that allows only one daemon on it.

The daemon uses the first of these folders that it can use; the client tries all of them in this order:
``$RUNTIME_DIRECTORY`` (systemd sets it for services), ``/run/wayfarer``, ``$XDG_RUNTIME_DIR/wayfarer``,
``/tmp/wayfarer-<uid>``. Any user can make the last one, so it is used only if it is private. Root's client also tries
the daemons of users who are logged in, in ``/run/user``, because sudo removes ``XDG_RUNTIME_DIR``.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from stat import S_IMODE, S_ISDIR

from wayfarer.errors import BadInput, WayfarerError

SYSTEM_FOLDER = Path("/run/wayfarer")
SESSIONS_FOLDER = Path("/run/user")
SHARED_FOLDER = Path("/tmp")
SOCKET_NAME = "control.sock"
_PRIVATE = 0o700


class AlreadyRunning(WayfarerError):
    """Another daemon runs on this socket, and was left alone."""

    exit_code = 75  # EX_TEMPFAIL of sysexits.h


def daemon_socket() -> Path:
    """Return where a daemon makes its socket.

    Raises:
        BadInput: the folder under ``/tmp`` is not private.
    """
    return next(socket for socket in known_sockets() if socket.parent != SYSTEM_FOLDER or _writable(SYSTEM_FOLDER))


def known_sockets() -> Iterator[Path]:
    """Give every place where a daemon's socket may be, in the order of preference.

    Raises:
        BadInput: the folder under ``/tmp`` is not private; only when it is reached.
    """
    if services := os.environ.get("RUNTIME_DIRECTORY"):
        yield Path(services.split(":")[0]) / SOCKET_NAME
    yield SYSTEM_FOLDER / SOCKET_NAME
    sessions = Path(os.environ.get("XDG_RUNTIME_DIR") or "nowhere")
    if sessions.is_absolute() and os.access(sessions, os.F_OK) and sessions.is_dir():  # is_dir() raises at long names
        yield sessions / "wayfarer" / SOCKET_NAME
    folder = SHARED_FOLDER / f"wayfarer-{os.geteuid()}"
    _refuse_if_shared(folder)
    yield folder / SOCKET_NAME
    if os.geteuid() == 0:  # last, so that a daemon of root never uses one of these
        yield from sorted(SESSIONS_FOLDER.glob(f"*/wayfarer/{SOCKET_NAME}"))


def _writable(folder: Path) -> bool:
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


def _refuse_if_shared(folder: Path) -> None:
    try:
        found = folder.lstat()
    except FileNotFoundError:
        return
    if not S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or S_IMODE(found.st_mode) != _PRIVATE:
        raise BadInput(
            f"{folder}: must be a folder that only user {os.geteuid()} can enter (mode 0700), but it belongs to user"
            f" {found.st_uid} with mode {S_IMODE(found.st_mode):04o}: somebody may be listening in; remove it"
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
