"""Tilt to one of four sides, and the rover on its back."""

from __future__ import annotations

from wayfarer.conditions import Condition
from wayfarer.detector.persistent import Persistent
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Anomaly
from wayfarer.hal import CompassReading

_TILTS = (Anomaly.NOSE_UP, Anomaly.NOSE_DOWN, Anomaly.RIGHT_DOWN, Anomaly.LEFT_DOWN)


class TiltWatch:
    """Looks at pitch and roll; each side persists by itself."""

    def __init__(self, settings: DetectorSettings) -> None:
        self._limit_deg = settings.tilt_deg
        self._overturned_deg = settings.overturned_deg
        self._tilts = {tilt: Persistent(settings.tilt_s) for tilt in _TILTS}
        self._overturned = Persistent(settings.overturned_s)
        self._tilted = False

    def update(
        self, t_s: float, believed: CompassReading, anomalies: list[Anomaly], conditions: list[Condition]
    ) -> None:
        """Take in a tick, and add what is found."""
        _, _, pitch_deg, roll_deg, _ = believed
        limit_deg = self._limit_deg
        if abs(pitch_deg) < limit_deg > abs(roll_deg) and not self._tilted:
            return
        self._tilted = False
        for tilt, angle_deg in zip(_TILTS, (pitch_deg, -pitch_deg, roll_deg, -roll_deg), strict=True):
            beyond = angle_deg >= limit_deg
            self._tilted |= beyond
            if self._tilts[tilt].update(t_s, beyond):
                anomalies.append(tilt)
        if self._overturned.update(t_s, max(abs(pitch_deg), abs(roll_deg)) >= self._overturned_deg):
            conditions.append(Condition.OVERTURNED)
