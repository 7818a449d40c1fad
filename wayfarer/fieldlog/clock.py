"""The wall clock: the only place in the field code that reads one."""

from __future__ import annotations

import time
from collections.abc import Callable

# The wall clock's time in seconds since 1970, given the loop's; a simulated run passes one that makes it reproducible.
WallClock = Callable[[float], float]


def wall_clock(_t_s: float) -> float:
    """Return the wall clock in seconds since 1970; it may step by hours when the computer finds the right time."""
    return time.time()
