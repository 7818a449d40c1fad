"""Detects tilt to one of four sides, tipping, and a rover on its back."""

from __future__ import annotations

from collections import deque
from typing import Final

from wayfarer.detector.ground_slope import GroundSlope
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Anomaly
from wayfarer.hal import CompassReading
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import Debounce

TILTS: Final = (Anomaly.NOSE_UP, Anomaly.NOSE_DOWN, Anomaly.RIGHT_DOWN, Anomaly.LEFT_DOWN)


class TiltMonitor:
    """Judges pitch and roll.

    A tilt to one of the four sides counts once it has lasted, separately for each side. It is counted from the ground.
    Counted from the horizontal, a tilt counts on any ground once a bump of half of the limit would bring the body to
    ``tipping_deg``.

    A body that is tipping over to a side counts as tilted at once: its tilt grows so fast that it would soon be too
    much. The rate is that of the slower of the last two steps between readings, so that one wrong reading or one bump
    does not count as tipping; nor does a tilt below half of the limit. Tipping and overturned are counted from the
    horizontal.
    """

    def __init__(self, settings: DetectorSettings, ground: GroundSlope) -> None:
        self._ground = ground
        self._limit_deg = settings.tilt_deg
        self._floor_deg = settings.tilt_deg / 2.0
        self._most_deg = max(settings.tilt_deg, settings.tipping_deg - self._floor_deg)
        self._tipping_deg, self._tipping_s = settings.tipping_deg, settings.tipping_s
        self._readings: deque[CompassReading] = deque(maxlen=3)
        self._overturned_deg = settings.overturned_deg
        self._tilts = {tilt: Debounce(settings.tilt_s) for tilt in TILTS}
        self._overturned = Debounce(settings.overturned_s)
        self._tilted = False

    def update(
        self, t_s: float, believed: CompassReading, anomalies: list[Anomaly], conditions: list[Condition]
    ) -> None:
        """Judge a tick, and add what is found to ``anomalies`` and ``conditions``."""
        read_t_s, heading_deg, pitch_deg, roll_deg, _ = believed
        readings = self._readings
        if not readings or readings[-1].t_s < read_t_s:
            readings.append(believed)
        ground, limit_deg, floor_deg = self._ground, self._limit_deg, self._floor_deg
        if ground.level and abs(pitch_deg) < floor_deg and abs(roll_deg) < floor_deg and not self._tilted:
            return  # nearly every tick ends here
        self._tilted = False
        slopes_deg = ground.towards_deg(heading_deg)
        for tilt, angle_deg, slope_deg in zip(TILTS, _towards_deg(believed), slopes_deg, strict=True):
            beyond = angle_deg - slope_deg >= limit_deg or angle_deg >= self._most_deg
            self._tilted |= beyond
            lasts = self._tilts[tilt].update(t_s, beyond)
            if lasts or (angle_deg >= floor_deg and self._tips(tilt)):
                anomalies.append(tilt)
        if self._overturned.update(t_s, max(abs(pitch_deg), abs(roll_deg)) >= self._overturned_deg):
            conditions.append(Condition.OVERTURNED)

    def _tips(self, tilt: Anomaly) -> bool:
        """Return whether the body will be tilted too far towards that side in a moment."""
        if len(self._readings) < 3:
            return False
        side = TILTS.index(tilt)
        old_deg, mid_deg, new_deg = (_towards_deg(reading)[side] for reading in self._readings)
        old_t_s, mid_t_s, new_t_s = (reading.t_s for reading in self._readings)
        rate_deg_s = min((mid_deg - old_deg) / (mid_t_s - old_t_s), (new_deg - mid_deg) / (new_t_s - mid_t_s))
        ahead_s = new_t_s - mid_t_s + self._tipping_s  # from the middle reading: the newest one alone may be wrong
        return rate_deg_s > 0.0 and mid_deg + rate_deg_s * ahead_s >= self._tipping_deg


def _towards_deg(reading: CompassReading) -> tuple[float, float, float, float]:
    """Return the tilt towards each of the four sides."""
    return reading.pitch_deg, -reading.pitch_deg, reading.roll_deg, -reading.roll_deg
