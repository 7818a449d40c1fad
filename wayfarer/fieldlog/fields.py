"""Lenient typed access to records: a wrong type reads as missing. Pure.

The reader leaves out a record with a value that cannot be. A key may still not be there, a failing part or a third
party's algorithm may have said anything, and a name need not be fit for a terminal.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from wayfarer.fieldlog.printable import escape_control_chars

# No time, distance, angle or voltage of a run comes near it: bytes of a number beyond it were changed.
MAX_PLAUSIBLE = 1e10
ELAPSED_DECIMALS = 6  # microseconds: a clock that has run for 31 years (``schema.SINCE_BOOT``) still counts them
# 2024-01-01: a clock that was never set stands before, at 1970 or at the day its system image was made.
CLOCK_SET_S = 1_704_067_200.0


def number(record: Mapping[str, Any], key: str) -> float | None:
    """Return a number, or None; none is NaN, or so large that sums of them overflow."""
    value = record.get(key)
    if isinstance(value, int | float) and -MAX_PLAUSIBLE < value < MAX_PLAUSIBLE and not isinstance(value, bool):
        return value
    return None


def integer(record: Mapping[str, Any], key: str) -> int | None:
    """Return a whole number, such as a seed with all its digits, or None."""
    value = record.get(key)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def safe_text(record: Mapping[str, Any], key: str) -> str | None:
    """Return a text that is fit for a terminal, or None."""
    value = record.get(key)
    return escape_control_chars(value) if isinstance(value, str) else None


def table(record: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return an object; an empty one where there is none."""
    value = record.get(key)
    return value if isinstance(value, dict) else {}


def setting(header: Mapping[str, Any], *keys: str) -> float | None:
    """Return a number of the rover file that a header holds, as ``vehicle`` and ``max_speed_m_s``; None without it."""
    *groups, key = keys
    found = table(header, "config")
    for group in groups:
        found = table(found, group)
    return number(found, key)


def duration_text(seconds: float | None, decimals: int = 0) -> str:
    """Return a time since the beginning, or a duration, as ``1:23:45``; empty where it is not known."""
    if seconds is None or not abs(seconds) < MAX_PLAUSIBLE:
        return ""
    tick = 10**decimals
    ticks = int(abs(seconds) * tick + 0.5)
    minutes, rest = divmod(ticks, 60 * tick)
    width = decimals + 3 if decimals else 2
    sign = "-" if seconds < 0.0 and ticks else ""
    return f"{sign}{minutes // 60}:{minutes % 60:02}:{rest / tick:0{width}.{decimals}f}"


def seconds_since(first: Mapping[str, Any], record: Mapping[str, Any]) -> float:
    """Return ``elapsed_s``, seconds since the first record of a log that can be read: by this all tools name a moment.

    ``t_s`` counts from an unknown moment, mostly the start of the computer. A record that stands behind the first one
    but has an earlier ``t_s`` gets a negative number.
    """
    return round(float(record["t_s"]) - float(first["t_s"]), ELAPSED_DECIMALS)


def clock_zero_s(header: Mapping[str, Any], first: Mapping[str, Any], last: Mapping[str, Any]) -> float | None:
    """Return the wall time, seconds since 1970, at which a log's ``t_s`` was zero; None where nothing tells.

    The last record says it best, because a rover's computer may find the right time only after a while. Where ``t_s``
    did not run as fast as the clock (a demo's), only the first record says when the run began.
    """
    told = last if (number(header, "time_scale") or 1.0) == 1.0 else first
    wall_s, t_s = number(told, "t_wall"), number(told, "t_s")
    return None if wall_s is None or t_s is None else wall_s - t_s


def began_wall_s(header: Mapping[str, Any], first: Mapping[str, Any], last: Mapping[str, Any]) -> float | None:
    """Return the wall time at which a run began, seconds since 1970; None where the clock was never set."""
    zero_s, first_t_s = clock_zero_s(header, first, last), number(first, "t_s")
    began_s = None if zero_s is None or first_t_s is None else zero_s + first_t_s
    return began_s if began_s is not None and began_s >= CLOCK_SET_S else None


def local_time(wall_s: float, form: str, *, utc: bool = False) -> str:
    """Return a wall time where the reader is, or in UTC; empty where no calendar reaches."""
    try:
        return time.strftime(form, time.gmtime(wall_s) if utc else time.localtime(wall_s))
    except (OverflowError, ValueError, OSError):
        return ""
