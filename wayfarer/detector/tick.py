"""The detector's part of the record of a control tick."""

from __future__ import annotations

from wayfarer.escape.api import Anomaly
from wayfarer.hal import CompassReading, ContactReading, MotionReading, Snapshot
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import TickInterval


class DetectorTick(TickInterval):
    """The readings of the sensors at a tick, and what the detector found in them.

    A reading is None where the sensor has not answered yet (motion: since the last tick).
    """

    compass: CompassReading | None = None
    motion: MotionReading | None = None
    contact: ContactReading | None = None
    anomalies: tuple[Anomaly, ...] = ()
    conditions: tuple[Condition, ...] = ()

    @property
    def snapshot(self) -> Snapshot:
        """The readings alone, to keep or compare them."""
        return Snapshot(self.t_s, self.compass, self.motion, self.contact)
