"""Health of the computer: temperature, power, load, disk. A hot or under-powered Pi slows down.

It is read in threads, because a hanging card may block a call that asks for its free space; the power flags have a
thread of their own, because the rover drives more gently by them.
"""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from wayfarer.commissioning.checks.system import THROTTLED

EVERY_S = 10.0  # field.md, users' complaint 34
POWER_EVERY_S = 1.0  # field catalogue, fault 32
CPU_TEMPERATURE = "/sys/class/thermal/thermal_zone0/temp"  # thousandths of a degree Celsius, on every Linux board

Health = Mapping[str, float | str | None]


class HostHealthMonitor:
    """Reads the computer's health every ``EVERY_S``, and its power flags every ``POWER_EVERY_S``, while it is entered.

    Args:
        logs: the folder whose disk is of interest; it need not be there.
        take: takes the health, in a thread of the watch.
        take_power: takes the firmware's power flags, None where it does not tell; in another thread of the watch.
        root: where the file system begins; another one in a test.
    """

    def __init__(
        self,
        logs: Path,
        take: Callable[[Health], None],
        take_power: Callable[[int | None], None],
        root: Path = Path("/"),
    ) -> None:
        self._logs = logs
        self._take = take
        self._take_power = take_power
        self._root = root
        self._ended = threading.Event()

    def __enter__(self) -> Self:
        self._start("computer watch", EVERY_S, lambda: self._take(health(self._logs, self._root)))
        self._start("power watch", POWER_EVERY_S, lambda: self._take_power(power_flags(self._root)))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._ended.set()

    def _start(self, name: str, every_s: float, tell: Callable[[], None]) -> None:
        threading.Thread(target=self._watch, args=(every_s, tell), name=name, daemon=True).start()

    def _watch(self, every_s: float, tell: Callable[[], None]) -> None:
        while not self._ended.is_set():
            with suppress(RuntimeError):  # the loop that is told has ended
                tell()
            self._ended.wait(every_s)


def health(logs: Path, root: Path = Path("/")) -> Health:
    """Return what the computer says of itself, None for what it does not: not every one is a Raspberry Pi."""
    cpu_mc = _text(root, CPU_TEMPERATURE)
    return {
        "cpu_c": int(cpu_mc) / 1000.0 if cpu_mc and cpu_mc.lstrip("-").isdecimal() else None,
        "throttled": _text(root, THROTTLED),
        "load_1min": round(os.getloadavg()[0], 2),
        "disk_free_mb": _free_mb(logs),
    }


def power_flags(root: Path = Path("/")) -> int | None:
    """Return the flags of ``wayfarer.safety.supply``, None where the computer does not tell."""
    try:
        return int(_text(root, THROTTLED) or "", 16)
    except ValueError:
        return None


def _text(root: Path, path: str) -> str | None:
    try:
        return (root / path.lstrip("/")).read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return None


def _free_mb(folder: Path) -> float | None:
    try:
        return round(shutil.disk_usage(folder).free / 1e6, 1)
    except OSError:
        return None
