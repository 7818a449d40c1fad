"""Odometer: distance from the motion sensor, or from the commands where the sensor is not usable. Pure."""

from __future__ import annotations

from wayfarer.detector.motion import MOST_SHARE
from wayfarer.hal import MotionReading
from wayfarer.safety.tick_interval import TickInterval


class Odometer:
    """Adds up the distance covered, ``covered_m``; driving forwards and backwards both increase it.

    Readings come less often than ticks. Between two readings the rover is assumed to cover the same share of the
    commanded distance as at the latest reading. Without a sensor that share is 1.

    Args:
        quality_min: the lowest quality of a reading that is used, 0 to 1.
    """

    def __init__(self, quality_min: float) -> None:
        self._quality_min = quality_min
        self.covered_m = 0.0
        self._read_m = self._commanded_m = self._commanded_before_m = 0.0
        self._share = 1.0

    def update(self, interval: TickInterval, motion: MotionReading | None) -> float:
        """Add a tick: the commands since the last one, and what the sensor saw since its last reading.

        Returns metres covered since the last tick, negative where the rover was commanded backwards.
        """
        self._commanded_m += abs(interval.forward_m)
        if motion is not None:
            self._take(motion)
        covered_m, before_m = self._read_m + self._share * self._commanded_m, self.covered_m
        if covered_m <= before_m:
            return 0.0
        self.covered_m = covered_m
        return covered_m - before_m if interval.forward_m >= 0.0 else before_m - covered_m

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
