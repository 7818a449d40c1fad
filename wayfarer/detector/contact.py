"""State and freshness of the bumpers."""

from __future__ import annotations

from math import inf

from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Anomaly
from wayfarer.hal import ContactReading
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import Debounce


class ContactMonitor:
    """Keeps the newest plausible reading in ``reading``, None before the first.

    ``touch_counts`` says whether a touch is an anomaly, ``needed`` whether silence is a condition.
    """

    def __init__(self, settings: DetectorSettings, *, touch_counts: bool, needed: bool) -> None:
        self._stale_s = settings.contact_stale_s
        self._touch_counts = touch_counts
        self._needed = needed
        self._touched = Debounce(settings.touch_s)
        self.reading: ContactReading | None = None
        self._seen: ContactReading | None = None
        self._read_t_s = -inf
        self._spoke_t_s = 0.0

    def start(self, t_s: float) -> None:
        """Begin the age now."""
        self._spoke_t_s = t_s

    def update(
        self, t_s: float, reading: ContactReading | None, anomalies: list[Anomaly], conditions: list[Condition]
    ) -> None:
        """Take in a tick, and add what is found."""
        if reading is not self._seen and reading is not None:
            self._take(t_s, reading)
        if self._needed:
            self._check(t_s, anomalies, conditions)

    def _take(self, t_s: float, reading: ContactReading) -> None:
        self._seen = reading
        read_t_s, _, bearing_deg = reading
        if self._read_t_s <= read_t_s <= t_s and (bearing_deg is None or 0.0 <= bearing_deg < 180.0):
            self.reading = reading
            self._read_t_s = self._spoke_t_s = read_t_s

    def _check(self, t_s: float, anomalies: list[Anomaly], conditions: list[Condition]) -> None:
        if t_s - self._spoke_t_s > self._stale_s:
            self._touched.update(t_s, False)
            conditions.append(Condition.CONTACT_STALE)
        elif self._touched.update(t_s, self._touch_counts and self.reading is not None and bool(self.reading.sides)):
            anomalies.append(Anomaly.TOUCHED)
