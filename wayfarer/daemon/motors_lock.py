"""A lock on the motors' device: only one program at a time drives a rover's motors.

The lock is the kernel's (flock) on the motors' own device file. So it needs no folder that all users may write to, and
it ends with the process in every case. Motors without such a file, on GPIO pins or on third-party buses, have no lock;
a GPIO pin can have only one owner anyway.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from wayfarer.daemon.socket.paths import AlreadyRunning

if TYPE_CHECKING:
    from wayfarer.config.rover_file import RoverConfig

LOCKS = Path("/proc/locks")
# Opening a serial port must not wait, and the port must not become the terminal of this process.
_QUIETLY = os.O_NONBLOCK | os.O_NOCTTY


class MotorsTaken(AlreadyRunning):
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
        MotorsTaken: another process holds it (it is an ``AlreadyRunning``).
    """
    file = None if device is None else _opened(device)
    if device is None or file is None:
        yield
        return
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise MotorsTaken(_holder(os.fstat(file)) or "another wayfarer", device) from None
        yield
    finally:
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
        MotorsTaken: another process holds its lock, as far as the kernel tells.
    """
    with suppress(OSError):
        if who := _holder(Path(device).stat()):
            raise MotorsTaken(who, device)


def _opened(device: str) -> int | None:
    for mode in (os.O_RDONLY, os.O_RDWR):
        with suppress(OSError):
            return os.open(device, mode | _QUIETLY)
    return None


def _holder(about: os.stat_result) -> str | None:
    """Say who has locked a file, None if nobody has, as far as the kernel tells."""
    inode = f"{os.major(about.st_dev):02x}:{os.minor(about.st_dev):02x}:{about.st_ino}"
    with suppress(OSError):
        for line in LOCKS.read_text(encoding="ascii").splitlines():
            _, kind, *fields = line.split()  # 1: FLOCK ADVISORY WRITE 1234 00:05:123 0 EOF
            if kind == "FLOCK" and inode in fields:
                return f"another wayfarer (process {fields[2]})"
    return None
