"""Times of a log: the wall clock, which only this module of the field code reads, and how times are written."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wayfarer.fieldlog.record import Record

# The wall clock's time in seconds since 1970, given the loop's; a simulated run passes one that makes it reproducible.
WallClock = Callable[[float], float]

ELAPSED_DECIMALS = 6  # microseconds: a clock that has run for 31 years (``record.Seconds``) still counts them
LONGEST_S = 1e10  # no duration of a run comes near it
# 2024-01-01: a clock that was never set stands before, at 1970 or at the day its system image was made.
CLOCK_SET_S = 1_704_067_200.0


def wall_clock(_t_s: float) -> float:
    """Return the wall clock in seconds since 1970; it may step by hours when the computer finds the right time."""
    return time.time()


def duration_text(seconds: float | None, decimals: int = 0) -> str:
    """Return a time since the beginning, or a duration, as ``1:23:45``; empty if it is not known."""
    if seconds is None or not abs(seconds) < LONGEST_S:
        return ""
    tick = 10**decimals
    ticks = int(abs(seconds) * tick + 0.5)
    minutes, rest = divmod(ticks, 60 * tick)
    width = decimals + 3 if decimals else 2
    sign = "-" if seconds < 0.0 and ticks else ""
    return f"{sign}{minutes // 60}:{minutes % 60:02}:{rest / tick:0{width}.{decimals}f}"


def began_wall_s(last: Record | None) -> float | None:
    """Return the wall time at which a run began, seconds since 1970; None if the clock was never set.

    The last record says it best, because a rover's computer may find the right time only after a while.
    """
    began_s = 0.0 if last is None else last.t_wall - last.elapsed_s
    return began_s if began_s >= CLOCK_SET_S else None


def local_time(wall_s: float, form: str, *, utc: bool = False) -> str:
    """Return a wall time where the reader is, or in UTC; empty if no calendar reaches."""
    try:
        return time.strftime(form, time.gmtime(wall_s) if utc else time.localtime(wall_s))
    except (OverflowError, ValueError, OSError):
        return ""
