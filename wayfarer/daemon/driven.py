"""What a daemon drives: a record of its motors beside its socket, and a lock on their device file.

The record names drivers and buses, so perhaps code to import; root asks who owns the file before it runs that. The lock
keeps other programs from driving the same motors. It is the kernel's (flock) on the motors' own device file, so it
needs no folder that all users may write to, and ends with the process in every case. Motors without such a file, on
GPIO pins or on third-party buses, have no lock; a GPIO pin can have only one owner anyway.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from wayfarer.config.registry import names_code
from wayfarer.daemon.socket import paths
from wayfarer.errors import BadInput
from wayfarer.files import write_atomically

if TYPE_CHECKING:
    from wayfarer.config.rover_file import RoverConfig

RECORD_NAME = "motors.json"
RECORD_BYTES = 65_536
LOCKS = Path("/proc/locks")


# -- the record ------------------------------------------------------------------------------------------------------


class DrivenBoard(NamedTuple):
    """A board: the table ``[parts.motors]`` of a rover file, unchanged, and the name of its buses."""

    motors: dict[str, Any]
    buses: str

    @property
    def names_code(self) -> bool:
        """Whether it names a function to import, and not only drivers and buses that are installed."""
        return names_code(self.motors["driver"]) or names_code(self.buses)


def write_record(socket_path: Path, driven: DrivenBoard) -> None:
    """Write the record of a daemon that holds ``paths.single_daemon`` for this socket, in place of a killed one's.

    Raises:
        BadInput: it cannot be written.
    """
    path = socket_path.with_name(RECORD_NAME)
    try:
        write_atomically(path, json.dumps(driven._asdict()), mode=0o600)
    except OSError as error:
        raise BadInput(f"{path}: the record of the motors cannot be written: {error.strerror}") from None


def remove_record(socket_path: Path) -> None:
    """Remove the record: the wheels are stopped, and no daemon drives them."""
    with suppress(OSError):
        socket_path.with_name(RECORD_NAME).unlink(missing_ok=True)


def known_records() -> Iterator[Path]:
    """Give every path where a daemon may have left its record, each once; ``read_record`` judges each."""
    return (folder / RECORD_NAME for folder in paths.known_folders())


def read_record(path: Path) -> tuple[DrivenBoard, os.stat_result] | None:
    """Return what a daemon recorded, and whose file it is; None if there is none, or none that this user may read.

    Raises:
        BadInput: no daemon wrote this; the text names the file.
    """
    try:
        # A symlink is not followed, and a pipe that nobody writes to does not block this.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
            about, text = os.fstat(file.fileno()), file.read(RECORD_BYTES)
        driven = DrivenBoard(**json.loads(text))
        if not isinstance(driven.motors["driver"], str) or not isinstance(driven.buses, str):
            raise TypeError
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return None
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        raise BadInput(f"{path}: rejected: no daemon wrote this; remove it") from None
    return driven, about


# -- the lock --------------------------------------------------------------------------------------------------------


class MotorsTaken(paths.AlreadyRunning):
    """Another program drives these motors; ``who`` names it, as far as it is known."""

    def __init__(self, who: str, device: str) -> None:
        super().__init__(
            f"{who} drives these motors ({device}): end it with 'wayfarer stop', or the service with"
            " 'sudo systemctl stop wayfarer'"
        )
        self.who = who


def motors_device(config: RoverConfig) -> str | None:
    """Return the device file that a rover's motors are on, None if there is none."""
    from wayfarer.config.rover_file import part_settings

    table = config.parts.get("motors")
    return None if table is None else device_of(config.buses, part_settings("motors", table)[1])


def device_of(buses: str, settings: object) -> str | None:
    """Return the device file of motors with these settings: their ``bus`` or ``port``, if it is one."""
    name = getattr(settings, "bus", None) or getattr(settings, "port", None)
    if buses != "linux" or not isinstance(name, str) or not name.startswith("/dev/"):
        return None
    return name if Path(name).is_char_device() else None


@contextmanager
def motors_lock(device: str | None) -> Iterator[None]:
    """Hold the lock of a device file while entered; without a file, or if it may not be opened, there is none.

    Raises:
        MotorsTaken: another process holds it.
    """
    file = -1
    for mode in () if device is None else (os.O_RDONLY, os.O_RDWR):
        with suppress(OSError):  # opened without waiting, and not as the terminal of this process
            file = os.open(str(device), mode | os.O_NONBLOCK | os.O_NOCTTY)
            break
    try:
        if file >= 0:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise MotorsTaken(_holder(os.fstat(file)) or "another wayfarer", str(device)) from None
        yield
    finally:
        if file >= 0:
            os.close(file)


def other_commander(device: str | None) -> str | None:
    """Return who else holds the lock of a device file, such as "another wayfarer (process 123)"; None if nobody."""
    try:
        with motors_lock(device):
            return None
    except MotorsTaken as taken:
        return taken.who


def refuse_taken(device: str) -> None:
    """Refuse a device file that another program has locked, without opening it: that may reset a board.

    Raises:
        MotorsTaken: another process holds its lock, as far as the kernel knows.
    """
    with suppress(OSError):
        if who := _holder(Path(device).stat()):
            raise MotorsTaken(who, device)


def _holder(about: os.stat_result) -> str | None:
    """Say who has locked a file, None if nobody has, as far as the kernel knows."""
    inode = f"{os.major(about.st_dev):02x}:{os.minor(about.st_dev):02x}:{about.st_ino}"
    with suppress(OSError):
        for line in LOCKS.read_text(encoding="ascii").splitlines():
            _, kind, *fields = line.split()  # 1: FLOCK ADVISORY WRITE 1234 00:05:123 0 EOF
            if kind == "FLOCK" and inode in fields:
                return f"another wayfarer (process {fields[2]})"
    return None
