"""Health of the computer: temperature, power, load, disk. A hot or under-powered Pi slows down.

It is read in threads, because a hanging card may block a call that asks for its free space; the power flags have a
thread of their own, because the rover drives more gently by them.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from wayfarer.commissioning.checks.card import CardHealth, card_health
from wayfarer.commissioning.checks.system import THROTTLED, power_flags, system_text
from wayfarer.fieldlog.disk import free_mb

EVERY_S = 10.0  # chosen by us: heat that slows the processor builds up over minutes
POWER_EVERY_S = 1.0  # fault catalogue, fault 32
OLD_RUNS_EVERY_S = 3600.0
CPU_TEMPERATURE = "/sys/class/thermal/thermal_zone0/temp"  # thousandths of a degree Celsius, on every Linux board

Health = Mapping[str, float | str | None]


@contextmanager
def monitor_host_health(
    logs: Path,
    take: Callable[[Health, CardHealth], None],
    take_power: Callable[[int | None], None],
    delete_old_runs: Callable[[], None] | None = None,
    root: Path = Path("/"),
) -> Iterator[None]:
    """Read the computer's health every ``EVERY_S``, and its power flags every ``POWER_EVERY_S``, while entered.

    Once an hour old runs are deleted.

    Args:
        logs: the folder whose disk is of interest; it need not be there.
        take: takes the health and that of the logs' disk, in a thread of the monitor.
        take_power: takes the firmware's power flags, None where it does not tell; in another thread of the monitor.
        delete_old_runs: deletes them, in another thread of the monitor; None where nothing is to be deleted.
        root: where the file system begins; another one in a test.
    """
    ended = threading.Event()

    def start(name: str, every_s: float, tell: Callable[[], None]) -> None:
        def watch() -> None:
            while not ended.is_set():
                with suppress(RuntimeError):  # the loop that is told has ended
                    tell()
                ended.wait(every_s)

        threading.Thread(target=watch, name=name, daemon=True).start()

    start("computer watch", EVERY_S, lambda: take(health(logs, root), card_health(logs, root)))
    start("power watch", POWER_EVERY_S, lambda: take_power(power_flags(root)))
    if delete_old_runs is not None:
        start("old runs", OLD_RUNS_EVERY_S, delete_old_runs)
    try:
        yield
    finally:
        ended.set()


def health(logs: Path, root: Path = Path("/")) -> Health:
    """Return what the computer reports, None for what it does not: not every one is a Raspberry Pi."""
    cpu_mc = system_text(CPU_TEMPERATURE, root)
    return {
        "cpu_c": int(cpu_mc) / 1000.0 if cpu_mc and cpu_mc.lstrip("-").isdecimal() else None,
        "throttled": system_text(THROTTLED, root),
        "load_1min": round(os.getloadavg()[0], 2),
        "disk_free_mb": _free_mb(logs),
    }


def _free_mb(folder: Path) -> float | None:
    try:
        return round(free_mb(folder), 1)
    except OSError:
        return None
