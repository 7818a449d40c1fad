"""The wall time of a log's records: the computer's clock, or the position receiver's where that one is wrong. Pure.

A Raspberry Pi without a network begins at the time of its last shutdown, or of its system image. A receiver knows the
time with its first position. Order and durations come from ``t_s`` in any case.
"""

from __future__ import annotations

from wayfarer.fieldlog.clock import CLOCK_SET_S, WallClock
from wayfarer.hal import PositionFix

STEP_S = 1.0  # more than a clock is slewed between two records; finding the right time steps it by hours
# A report comes up to a second after its moment, and may be read 3 s later (``gpsd.GpsdSettings.stale_s``).
WRONG_S = 5.0
AGREE_S = 1.0  # two reports of one receiver, whatever both are late by
# The satellites count weeks from 0 to 1023 (IS-GPS-200, 20.3.3.3.1.1): a receiver that is older than a roll-over says a
# date that is 19.6 years too early.
ROLL_OVER_S = 1024 * 7 * 86_400.0


def believed_utc_s(utc_s: float | None) -> float | None:
    """Return a receiver's time in seconds since 1970, put right by one roll-over; None where it cannot be right."""
    if utc_s is None:
        return None
    if utc_s < CLOCK_SET_S:
        utc_s += ROLL_OVER_S
    return utc_s if CLOCK_SET_S <= utc_s < CLOCK_SET_S + ROLL_OVER_S else None


class LogClock:
    """Gives the wall time of records.

    Args:
        wall: the computer's clock, given the loop's time.
    """

    def __init__(self, wall: WallClock) -> None:
        self._wall = wall
        self._offset_s: float | None = None  # of the computer's clock from the loop's, when it was last asked
        self._zero_s: float | None = None  # wall time at which the loop's is 0, while the receiver gives it
        self._fix_t_s = self._said_zero_s = float("-inf")

    def wall_s(self, t_s: float) -> float:
        """Return the wall time at a time of the loop, in seconds since 1970."""
        return self._wall(t_s) if self._zero_s is None else self._zero_s + t_s

    def step_s(self, t_s: float) -> float:
        """Return by how much the computer's clock was set since the last call; 0 where it was not."""
        offset_s = self._wall(t_s) - t_s
        before_s, self._offset_s = self._offset_s, offset_s
        if before_s is None or abs(offset_s - before_s) <= STEP_S:
            return 0.0
        return offset_s - before_s

    def take(self, fix: PositionFix) -> float | None:
        """Take a fix; return by how much the computer's clock is wrong where that is news: 0.0 if it is right again.

        Two fixes in a row must agree, so that a single wild one changes nothing.
        """
        utc_s = believed_utc_s(fix.utc_s)
        if utc_s is None or fix.t_s == self._fix_t_s:
            return None
        zero_s = utc_s - fix.t_s
        agrees = abs(zero_s - self._said_zero_s) <= AGREE_S
        self._fix_t_s, self._said_zero_s = fix.t_s, zero_s
        return self._judge(self._wall(fix.t_s) - utc_s, zero_s) if agrees else None

    def _judge(self, wrong_by_s: float, zero_s: float) -> float | None:
        follows = self._zero_s
        if abs(wrong_by_s) <= WRONG_S:
            self._zero_s = None
            return None if follows is None else 0.0
        if follows is not None and abs(zero_s - follows) <= WRONG_S:
            return None
        self._zero_s = zero_s
        return wrong_by_s
