"""Wall times of an export: ``t_s`` and the time at which the log's clock was zero, so that they are in order.

They are right at the end of the log, where the rover's computer is most likely to know the time. Pure but for reading.
"""

from __future__ import annotations

from collections import deque
from datetime import UTC, datetime, timedelta

from wayfarer.angles import clamp
from wayfarer.fieldlog.reader import RunReader

SECOND_NS = 1_000_000_000
LATEST_S = 2**32 - 1  # in the year 2106, where the seconds of Foxglove's times end


def read_clock_zero_s(reader: RunReader) -> float:
    """Read a run to its end, and return the time since 1970 at which its ``t_s`` was zero.

    Raises:
        BadInput: the run cannot be read.
    """
    (last,) = deque(reader, maxlen=1)
    return last.t_wall - last.t_s


def nanoseconds(time_s: float) -> int:
    """Return a time since 1970 as Foxglove counts it, to the microsecond: a float of today has no more."""
    return round(clamp(time_s, 0.0, LATEST_S) * 1e6) * 1000


def utc_time(wall_s: float) -> datetime:
    """Return a time since 1970 to the millisecond, within the same bounds as ``nanoseconds``."""
    return datetime.fromtimestamp(round(nanoseconds(wall_s) / 1e6) / 1e3, UTC)


def utc_stamp(wall_s: float) -> datetime:
    """Return a log's ``t_wall`` to the microsecond; it is from 1970 to 2286 (``record.Wall``)."""
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=round(wall_s * 1e6))
