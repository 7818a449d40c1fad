"""Path of the control socket, and the lock that allows only one daemon on it.

A daemon uses the first of these folders: ``$RUNTIME_DIRECTORY`` (systemd sets it for services), ``/run/wayfarer`` if it
is there and this user may write to it, ``$XDG_RUNTIME_DIR/wayfarer`` (logind sets that for logins). The client tries
all of them in this order. Root's also tries the daemons of users who are logged in, in ``/run/user``, because sudo
removes ``XDG_RUNTIME_DIR``. Only root or the user can have made any of them, so no other user can put a false daemon
there, which answers that it has stopped. A session's folder that others may write to, such as ``/tmp``, is refused.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from stat import S_IMODE, S_ISDIR

from wayfarer.errors import BadInput, WayfarerError

SYSTEM_FOLDER = Path("/run/wayfarer")
SESSIONS_FOLDER = Path("/run/user")
SOCKET_NAME = "control.sock"
OTHERS_WRITE = 0o022


class AlreadyRunning(WayfarerError):
    """Another daemon runs on this socket, and was left alone."""

    exit_code = 75  # EX_TEMPFAIL of sysexits.h


def daemon_socket() -> Path:
    """Return where a daemon makes its socket.

    Raises:
        BadInput: there is no folder for it; the text names the variable to set.
    """
    if services := os.environ.get("RUNTIME_DIRECTORY"):
        return Path(services.split(":")[0]) / SOCKET_NAME
    if os.access(SYSTEM_FOLDER, os.W_OK | os.X_OK):
        return SYSTEM_FOLDER / SOCKET_NAME
    if why := no_session():
        raise BadInput(
            f"no folder for the control socket: {why}; set it to a folder that only you may write to, here and for the"
            " commands that ask this daemon: mkdir -m 700 ~/wayfarer-run; export XDG_RUNTIME_DIR=~/wayfarer-run"
        )
    return _session_folder() / SOCKET_NAME


def without_daemon() -> AbstractContextManager[None]:
    """Keep this user's daemon from running while entered; if it would have no folder, it cannot run.

    Raises:
        AlreadyRunning, BadInput: as ``single_daemon``.
    """
    try:
        return single_daemon(daemon_socket())
    except BadInput:
        return nullcontext()


def known_sockets() -> list[Path]:
    """Return every place where a daemon's socket may be, in the order of preference."""
    return [folder / SOCKET_NAME for folder in known_folders()]


def known_folders() -> list[Path]:
    """Return every folder where a daemon may be or have been, each once, in the order of preference."""
    services = os.environ.get("RUNTIME_DIRECTORY")
    folders = [Path(services.split(":")[0])] if services else []
    folders.append(SYSTEM_FOLDER)
    if not no_session():
        folders.append(_session_folder())
    if os.geteuid() == 0:
        # The session of who gave sudo comes first: the daemon of another user is hardly the one that is meant.
        sudo = os.environ.get("SUDO_UID", "")
        found = SESSIONS_FOLDER.glob("*/wayfarer")
        folders += sorted(found, key=lambda folder: (folder.parent.name != sudo, folder))
    return list(dict.fromkeys(folders))


def no_session() -> str:
    """Return why a daemon of this user can have no socket in the folder of a login session; empty if it can."""
    named = os.environ.get("XDG_RUNTIME_DIR")
    if not named:
        return "XDG_RUNTIME_DIR is not set"
    about = None
    with suppress(OSError):
        about = Path(named).stat()
    if about is None or not named.startswith("/") or not S_ISDIR(about.st_mode):
        why = "which is not a folder, or not from / on"
    elif about.st_mode & OTHERS_WRITE:
        why = f"to which others may write (mode {S_IMODE(about.st_mode):04o})"
    elif about.st_uid not in {0, os.geteuid()}:
        why = f"which belongs to user {about.st_uid}"
    else:
        return ""
    return f"XDG_RUNTIME_DIR is {named}, {why}"


def _session_folder() -> Path:
    return Path(os.environ["XDG_RUNTIME_DIR"]) / "wayfarer"


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
        socket_path.parent.mkdir(mode=0o700, exist_ok=True)
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
