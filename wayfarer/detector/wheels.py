"""What the wheels' own sensor says: fresh and possible, or not."""

from __future__ import annotations

from math import inf

from wayfarer.detector.settings import DetectorSettings
from wayfarer.hal import WheelReading
from wayfarer.safety.conditions import Condition


class WheelMonitor:
    """Judges each reading once: ``reading`` is this tick's, None if there is none that can be.

    ``spoke_t_s`` is when the sensor last said something.
    """

    def __init__(self, settings: DetectorSettings) -> None:
        self._stale_s = settings.wheels_stale_s
        self.spoke_t_s = 0.0
        self._read_t_s = -inf
        self.reading: WheelReading | None = None

    def update(self, t_s: float, reading: WheelReading | None, conditions: list[Condition]) -> None:
        """Take in a tick, and add what is found."""
        self.reading = None
        if reading is not None and self._read_t_s < reading.t_s <= t_s:
            self.reading = reading
            self._read_t_s = self.spoke_t_s = reading.t_s
        if t_s - self.spoke_t_s > self._stale_s:
            conditions.append(Condition.WHEELS_STALE)
