"""Detects motion while the wheels are commanded to stop."""

from __future__ import annotations

from collections import deque
from math import copysign, radians, sin
from typing import Final

from wayfarer.detector.ground import LOAD_MAX
from wayfarer.detector.settings import DetectorSettings
from wayfarer.safety.tick_interval import ROUNDING_S

G_M_S2: Final = 9.81
# Motors that are told 0 brake, but do not hold: from 3 degrees on, a body rolls (the rolling resistance of
# ``simhal.world.wheeled_body``), and on mud its braked wheels slide from 6 degrees on (a friction of 0.1). A compass
# has some degrees of noise.
SLIDES_FROM_DEG: Final = 4.0
# Chosen by us: after so long the body has come to rest, or rolls, or is at the foot of the slope. When it was told to
# stop it was at most so many times as fast as at full duty: one that was driven down a slope of mud was 1.9 times.
SLIDES_S: Final = 10.0
FASTEST: Final = 2.0
# A flow sensor at another height than configured sees more than the wheels do: by half, measured with ``FIELD``.
FLOW_SCALE_MAX: Final = 1.5


class RunawayMonitor:
    """Finds motion without a command, in one direction; ``found`` says whether it has lasted long enough.

    A body that coasts loses speed, at least ``gain_m_s2`` on the most slippery ground. While it does, it is
    not running away. This monitor does not know whether the rover is armed; a person may push one that is not, so
    the controller ignores the finding then.

    Nor is a body that gravity moves downhill. It rolls, no faster than the speed at which its braked motors take up its
    weight; or it slides, but only for ``SLIDES_S`` after the stop, and no faster than ``FASTEST`` and what free fall
    along the slope has added since. What is faster is driven.

    Args:
        settings: how fast, for how long, and how long after the stop it must move.
        max_speed_m_s: ground speed at full duty.
    """

    def __init__(self, settings: DetectorSettings, max_speed_m_s: float) -> None:
        self._after_s = settings.runaway_after_s - ROUNDING_S
        self._for_s = settings.runaway_for_s - ROUNDING_S
        self._from_m_s = settings.runaway_from_m_s
        self._loss_m_s2 = settings.gain_m_s2
        self._max_speed_m_s = max_speed_m_s
        self._coasting: deque[tuple[float, float]] = deque()  # how long zero had been commanded, and the speed
        self._moving_s = 0.0
        self._way = 0.0
        self._pitch_deg = self._falls_ahead_deg = self._falls_back_deg = 0.0
        self.found = False

    def clear(self) -> None:
        """Forget: nothing is known of the time before now."""
        self._coasting.clear()
        self._halt()

    def stands_at(self, pitch_deg: float, falls_ahead_deg: float, falls_back_deg: float) -> None:
        """Take how the body stands.

        Args:
            pitch_deg: the body's pitch, nose up; 0 if it is not known.
            falls_ahead_deg: how far the ground falls ahead of it, as far as that is known; the most that it may.
            falls_back_deg: the same behind it.
        """
        self._pitch_deg, self._falls_ahead_deg, self._falls_back_deg = pitch_deg, falls_ahead_deg, falls_back_deg

    def add(self, dt_s: float, stood_s: float, moved_m: float, *, signed: bool = True) -> None:
        """Add a reading: the body moved ``moved_m`` in the last ``dt_s``; zero has been commanded for ``stood_s``.

        It counts if most of ``dt_s`` is after the time for coasting. If the sensor sees no direction, the motion may
        be downhill.
        """
        if self._coasting and stood_s <= self._coasting[-1][0]:
            self.clear()
        speed_m_s = abs(moved_m) / dt_s
        coasts = self._slows_down(stood_s, speed_m_s)
        if stood_s - dt_s / 2 < self._after_s or speed_m_s < self._from_m_s or coasts:
            self._halt()
            return
        way = copysign(1.0, moved_m)
        if self._is_pulled(stood_s, speed_m_s, way) or (not signed and self._is_pulled(stood_s, speed_m_s, -way)):
            self._halt()
            return
        self._moving_s = self._moving_s + dt_s if way == self._way else dt_s
        self._way = way
        self.found = self._moving_s >= self._for_s

    def _halt(self) -> None:
        """Begin to count again: the rover does not move, or its motion is allowed."""
        self._moving_s, self._way = 0.0, 0.0
        self.found = False

    def _is_pulled(self, stood_s: float, speed_m_s: float, way: float) -> bool:
        """Return whether gravity can move a braked body so fast this way."""
        falls_deg = max(-way * self._pitch_deg, self._falls_ahead_deg if way > 0.0 else self._falls_back_deg)
        fall = sin(radians(falls_deg))
        if speed_m_s <= FLOW_SCALE_MAX * LOAD_MAX * fall * self._max_speed_m_s:
            return True
        slides_m_s = FASTEST * self._max_speed_m_s + G_M_S2 * fall * stood_s
        return falls_deg >= SLIDES_FROM_DEG and stood_s <= SLIDES_S and speed_m_s <= slides_m_s

    def _slows_down(self, stood_s: float, speed_m_s: float) -> bool:
        """Return whether the speed has fallen by at least ``gain_m_s2``, measured over ``runaway_for_s``."""
        speeds = self._coasting
        speeds.append((stood_s, speed_m_s))
        while len(speeds) > 1 and stood_s - speeds[1][0] >= self._for_s:
            speeds.popleft()
        then_s, then_m_s = speeds[0]
        over_s = stood_s - then_s
        return over_s >= self._for_s and then_m_s - speed_m_s >= self._loss_m_s2 * over_s
