"""Latest values of the sensors: sensor tasks write them at their own rates, the control tick reads all at once."""

from __future__ import annotations

from math import isfinite
from typing import Generic, TypeVar

from wayfarer.detector.detector import DetectorTick
from wayfarer.hal import CompassReading, ContactReading, MotionReading

R = TypeVar("R")


class LatestValue(Generic[R]):
    """Holds the newest reading; an unread older one is overwritten."""

    __slots__ = ("reading",)

    def __init__(self) -> None:
        self.reading: R | None = None

    def write(self, reading: R) -> None:
        """Replace the reading."""
        self.reading = reading


class MotionBuffer:
    """Adds up displacements until the tick takes them, so that none is lost at any sensor rate.

    The quality of the sum is that of its worst part, because the sum of only some displacements is wrong. If time or
    quality of a part is NaN or infinite, the quality of the sum is 0 (fault catalogue, fault 8).
    """

    __slots__ = ("_pending", "latest")

    def __init__(self) -> None:
        self._pending: MotionReading | None = None
        self.latest: MotionReading | None = None

    def write(self, reading: MotionReading) -> None:
        """Add a reading to the pending sum; ``latest`` is the reading itself."""
        self.latest = reading
        pending = self._pending
        if pending is not None:
            known = isfinite(pending.t_s + pending.quality + reading.t_s + reading.quality)
            reading = MotionReading(
                reading.t_s,
                pending.forward_m + reading.forward_m,
                pending.right_m + reading.right_m,
                min(pending.quality, reading.quality) if known else 0.0,
                reading.signed,
            )
        self._pending = reading

    def take(self) -> MotionReading | None:
        """Return the displacement since the last take, or None if nothing was read since."""
        pending = self._pending
        self._pending = None
        return pending


class SensorBuffers:
    """The buffers of one rover."""

    __slots__ = ("compass", "contact", "motion")

    def __init__(self) -> None:
        self.compass: LatestValue[CompassReading] = LatestValue()
        self.motion = MotionBuffer()
        self.contact: LatestValue[ContactReading] = LatestValue()

    def read(self, tick: DetectorTick) -> None:
        """Fill in the newest readings of all sensors."""
        tick.compass, tick.motion, tick.contact = self.compass.reading, self.motion.take(), self.contact.reading
