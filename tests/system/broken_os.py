"""A computer whose disk is slow, or whose wall clock is set, from a moment on: for a process that falls ill at first.

While there is a file ``slow_disk`` in the working directory, its number is how many seconds each sync takes longer; one
named ``clock_step`` is by how many seconds the wall clock is wrong. Wayfarer itself is unchanged and knows nothing of
it: what changes is what its calls of the operating system do.
"""

# ruff: noqa: TID251 - it stands for the clock
from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

SLOW_DISK, CLOCK_STEP = "slow_disk", "clock_step"


def _number(name: str) -> float:
    """Return the number in a file, 0 if there is none."""
    try:
        return float(Path(name).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return 0.0


def _slowed(sync: Callable[[int], None]) -> Callable[[int], None]:
    def slow(descriptor: int) -> None:
        time.sleep(_number(SLOW_DISK))
        sync(descriptor)

    return slow


def _stepped(clock: Callable[[], float]) -> Callable[[], float]:
    return lambda: clock() + _number(CLOCK_STEP)


def patch_os() -> None:
    """Replace the calls of the operating system in this process."""
    system: Any = os
    system.fsync, system.fdatasync = _slowed(os.fsync), _slowed(os.fdatasync)
    clock: Any = time
    clock.time = _stepped(time.time)
