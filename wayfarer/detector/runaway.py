"""Detects motion while the wheels are commanded to stop."""

from __future__ import annotations

from collections import deque
from math import copysign
from typing import Final

from wayfarer.detector.settings import DetectorSettings
from wayfarer.safety.tick_interval import ROUNDING_S

# Motors that are told 0 brake, but do not hold: from 3 degrees on, a body rolls (the rolling resistance of
# ``simhal.world.wheeled_body``), and on mud it slides ever faster from 6 degrees on (a friction of 0.1). A compass has
# some degrees of noise.
ROLLS_FROM_DEG: Final = 4.0


class RunawayMonitor:
    """Finds motion without a command, in one direction; ``found`` says whether it has lasted long enough.

    A body that coasts loses speed, at least ``gain_m_s2`` on the most slippery ground. While it does, it is
    not running away. This monitor does not know whether the rover is armed; a person may push one that is not, so
    the controller ignores the finding then.

    Nor is a body on a slope that moves downhill: gravity cannot be told from motors there, and a stop does not end it.
    ``pitch_deg`` is the body's pitch, nose up.
    """

    def __init__(self, settings: DetectorSettings) -> None:
        self.pitch_deg = 0.0
        self._after_s = settings.runaway_after_s - ROUNDING_S
        self._for_s = settings.runaway_for_s - ROUNDING_S
        self._from_m_s = settings.runaway_from_m_s
        self._loss_m_s2 = settings.gain_m_s2
        self._coasting: deque[tuple[float, float]] = deque()  # how long zero had been commanded, and the speed
        self._moving_s = 0.0
        self._way = 0.0
        self.found = False

    def clear(self) -> None:
        """Forget: nothing is known of the time before now."""
        self._coasting.clear()
        self._halt()

    def add(self, dt_s: float, stood_s: float, moved_m: float) -> None:
        """Add a reading: the body moved ``moved_m`` in the last ``dt_s``; zero has been commanded for ``stood_s``.

        It counts if most of ``dt_s`` is after the time for coasting.
        """
        if self._coasting and stood_s <= self._coasting[-1][0]:
            self.clear()
        speed_m_s = moved_m / dt_s
        coasts = self._slows_down(stood_s, abs(speed_m_s))
        if stood_s - dt_s / 2 < self._after_s or abs(speed_m_s) < self._from_m_s or coasts or self._rolls(speed_m_s):
            self._halt()
            return
        way = copysign(1.0, moved_m)
        self._moving_s = self._moving_s + dt_s if way == self._way else dt_s
        self._way = way
        self.found = self._moving_s >= self._for_s

    def _halt(self) -> None:
        """Begin to count again: the rover does not move, or its motion is allowed."""
        self._moving_s, self._way = 0.0, 0.0
        self.found = False

    def _rolls(self, speed_m_s: float) -> bool:
        """Return whether the body moves downhill."""
        return abs(self.pitch_deg) >= ROLLS_FROM_DEG and speed_m_s * self.pitch_deg < 0.0

    def _slows_down(self, stood_s: float, speed_m_s: float) -> bool:
        """Return whether the speed has fallen by at least ``gain_m_s2``, measured over ``runaway_for_s``."""
        speeds = self._coasting
        speeds.append((stood_s, speed_m_s))
        while len(speeds) > 1 and stood_s - speeds[1][0] >= self._for_s:
            speeds.popleft()
        then_s, then_m_s = speeds[0]
        over_s = stood_s - then_s
        return over_s >= self._for_s and then_m_s - speed_m_s >= self._loss_m_s2 * over_s
