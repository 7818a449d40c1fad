"""The detector's part of the record of a control tick."""

from __future__ import annotations

from wayfarer.escape.api import Anomaly
from wayfarer.hal import CompassReading, ContactReading, MotionReading, Snapshot
from wayfarer.safety.conditions import Condition
from wayfarer.safety.interval import Interval


class DetectorTick(Interval):
    """What the sensors say at a tick, and what is found in it.

    A reading is None where the sensor has not spoken (motion: since the last tick).
    """

    compass: CompassReading | None = None
    motion: MotionReading | None = None
    contact: ContactReading | None = None
    anomalies: tuple[Anomaly, ...] = ()
    conditions: tuple[Condition, ...] = ()

    @property
    def snapshot(self) -> Snapshot:
        """The readings, for those who keep or compare them."""
        return Snapshot(self.t_s, self.compass, self.motion, self.contact)
