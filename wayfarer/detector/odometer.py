"""Odometer: distance and displacement from the motion sensor, or from the commands where it is not usable. Pure."""

from __future__ import annotations

from typing import Final

from wayfarer.detector.motion import MOST_SHARE
from wayfarer.hal import MotionReading
from wayfarer.safety.tick_interval import TickInterval

# No rover goes so far from one reading to the next: after a long silence a sensor may add up what it did not see.
READING_MAX_M: Final = 1.0


class Odometer:
    """Adds up the distance covered, ``covered_m``; driving forwards and backwards both increase it.

    Only what was commanded counts as covered: that is what an algorithm asks. The *displacement* that ``update``
    returns is for dead reckoning, and has all that was seen: a body on a slope slides while it turns, or while its
    wheels push it uphill.

    Readings come less often than ticks. Between two readings the rover is assumed to cover the same share of the
    commanded distance as at the latest reading. Without a sensor that share is 1. What was assumed too far, as of a
    body that stalls, is subtracted from the next readings, until the direction changes.

    Args:
        quality_min: the lowest quality of a reading that is used, 0 to 1.
    """

    def __init__(self, quality_min: float) -> None:
        self._quality_min = quality_min
        self.covered_m = 0.0
        self._read_m = self._commanded_m = self._commanded_before_m = 0.0
        self._share = 1.0
        self._ahead = True
        self._assumed_m = 0.0  # displacement ahead since the last reading

    def update(self, interval: TickInterval, motion: MotionReading | None) -> tuple[float, float]:
        """Add a tick: the commands since the last one, and what the sensor saw since its last reading.

        Returns the displacement since the last tick, metres ahead and to the right. Between two readings it is assumed
        as well; the next reading corrects that.
        """
        if interval.forward_m and (interval.forward_m > 0.0) is not self._ahead:
            self._ahead = not self._ahead
            # Before a body was seen to stand it was assumed to go on. That must not be subtracted from the way back.
            self._read_m = self.covered_m - self._share * self._commanded_m
        self._commanded_m += abs(interval.forward_m)
        if motion is not None:
            self._take(motion)
        before_m = self.covered_m
        self.covered_m = max(self._read_m + self._share * self._commanded_m, before_m)
        ahead_m = self.covered_m - before_m if interval.forward_m >= 0.0 else before_m - self.covered_m
        if motion is None:
            self._assumed_m += ahead_m
            return ahead_m, 0.0
        assumed_m, self._assumed_m = self._assumed_m, 0.0
        known = motion.signed and self._quality_min <= motion.quality
        if known and max(abs(motion.forward_m), abs(motion.right_m)) <= READING_MAX_M:
            return motion.forward_m - assumed_m, motion.right_m
        return ahead_m, 0.0

    def _take(self, motion: MotionReading) -> None:
        commanded_m, before_m = self._commanded_m, self._commanded_before_m
        self._commanded_m, self._commanded_before_m = 0.0, commanded_m
        moved_m = commanded_m
        if self._quality_min <= motion.quality <= 1.0:  # written so that NaN counts as driven
            most_m = MOST_SHARE * (commanded_m if commanded_m > before_m else before_m)
            seen_m = abs(motion.forward_m)
            moved_m = seen_m if seen_m < most_m else most_m
        self._read_m += moved_m
        self._share = moved_m / commanded_m if moved_m < commanded_m else 1.0
