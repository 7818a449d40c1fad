"""A lock on the motors' device: only one program at a time drives a rover's motors.

The lock is the kernel's (flock) on the motors' own device file, so it needs no place that all users may write to, and
ends with the process, however that ends. Motors without such a file, on GPIO pins or on buses of somebody else's, have
none: pins have one owner anyway.
"""

from __future__ import annotations

import fcntl
import os
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from wayfarer.daemon.socket.paths import AlreadyRunning

if TYPE_CHECKING:
    from wayfarer.config.rover_file import RoverConfig

LOCKS = Path("/proc/locks")
# A serial port must neither be waited for nor become the terminal of this process.
_QUIETLY = os.O_NONBLOCK | os.O_NOCTTY
_NONE = -1


class MotorsTaken(AlreadyRunning):
    """Another program drives these motors; ``who`` says which, as far as it is known."""

    def __init__(self, who: str, device: str) -> None:
        super().__init__(
            f"{who} drives these motors ({device}): end it with 'wayfarer stop', or the service with"
            " 'sudo systemctl stop wayfarer'"
        )
        self.who = who


def motors_device(config: RoverConfig) -> str | None:
    """Return the device file that a rover's motors are on, None where there is none."""
    from wayfarer.config.rover_file import part_settings

    table = config.parts.get("motors")
    return None if table is None else device_of(config.buses, part_settings("motors", table)[1])


def device_of(buses: str, settings: object) -> str | None:
    """Return the device file of motors with these settings: their ``bus`` or ``port``, if it is one."""
    name = getattr(settings, "bus", None) or getattr(settings, "port", None)
    if buses != "linux" or not isinstance(name, str) or not name.startswith("/dev/"):
        return None
    return name if Path(name).is_char_device() else None


class MotorsLock:
    """Holds the lock of a device file for as long as it is entered; without one, or if it may not be opened, none.

    Raises:
        MotorsTaken: another process holds it (it is an ``AlreadyRunning``).
    """

    def __init__(self, device: str | None) -> None:
        self._device = device
        self._file = _NONE

    def __enter__(self) -> Self:
        if self._device is not None:
            self._take(self._device)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._file != _NONE:
            os.close(self._file)
            self._file = _NONE

    def _take(self, device: str) -> None:
        file = _opened(device)
        if file == _NONE:
            return
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            who = _holder(file)
            os.close(file)
            raise MotorsTaken(who, device) from None
        self._file = file


def other_commander(device: str | None) -> str | None:
    """Return who else holds the lock of a device file, such as "another wayfarer (process 123)"; None if nobody."""
    try:
        with MotorsLock(device):
            return None
    except MotorsTaken as taken:
        return taken.who


def _opened(device: str) -> int:
    for mode in (os.O_RDONLY, os.O_RDWR):
        with suppress(OSError):
            return os.open(device, mode | _QUIETLY)
    return _NONE


def _holder(file: int) -> str:
    """Say who has locked an open file, as far as the kernel tells."""
    about = os.fstat(file)
    inode = f"{os.major(about.st_dev):02x}:{os.minor(about.st_dev):02x}:{about.st_ino}"
    with suppress(OSError):
        for line in LOCKS.read_text(encoding="ascii").splitlines():
            _, kind, *fields = line.split()  # 1: FLOCK ADVISORY WRITE 1234 00:05:123 0 EOF
            if kind == "FLOCK" and inode in fields:
                return f"another wayfarer (process {fields[2]})"
    return "another wayfarer"
