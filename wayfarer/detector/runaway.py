"""Ground that moves although the wheels were told to stand."""

from __future__ import annotations

from math import copysign

from wayfarer.detector.settings import DetectorSettings


class Runaway:
    """Finds motion without a command, in one direction; ``found`` says whether it has lasted.

    Whether the rover is armed it does not know: a person may push one that is not.
    """

    def __init__(self, settings: DetectorSettings) -> None:
        self._after_s = settings.runaway_after_s - 1e-6
        self._for_s = settings.runaway_for_s - 1e-6
        self._from_m_s = settings.runaway_from_m_s
        self.clear()

    def clear(self) -> None:
        """Forget: nothing is known of the time before now."""
        self._moving_s = 0.0
        self._way = 0.0
        self.found = False

    def add(self, dt_s: float, stood_s: float, moved_m: float) -> None:
        """Add a reading of the last ``dt_s``: how far the ground went; zero had been commanded for ``stood_s`` by then.

        It counts when most of it is after the time for coasting.
        """
        if stood_s - dt_s / 2 < self._after_s or abs(moved_m) < self._from_m_s * dt_s:
            self.clear()
            return
        way = copysign(1.0, moved_m)
        self._moving_s = self._moving_s + dt_s if way == self._way else dt_s
        self._way = way
        self.found = self._moving_s >= self._for_s
