"""Heading control: a PID controller from heading error to turn rate (paper, section III-A)."""

from __future__ import annotations

from math import copysign, cos, degrees, radians
from typing import Final

from wayfarer.escape.api import EscapeSettings
from wayfarer.escape.turn_control import TurnController
from wayfarer.hal import WheelCommand

# Bound of the integral, in rad s: with the default gain it adds at most 17 degrees a second. It learns unequal sides,
# and must not wind up while something holds the rover.
INTEGRAL_MAX_RAD_S: Final = 1.5


class HeadingHold:
    """Drives along a heading; beyond ``pivot_beyond_deg`` of error it turns on the spot instead."""

    def __init__(self, settings: EscapeSettings, turns: TurnController) -> None:
        self._p, self._i, self._d = settings.heading_p, settings.heading_i, settings.heading_d
        self._cruise_m_s = settings.cruise_m_s
        self._turn_limit_rad_s = radians(settings.turn_deg_s)
        self._pivot_beyond_deg = settings.pivot_beyond_deg
        self._turns = turns
        self.reset()

    def reset(self) -> None:
        """Forget the past: the next error is the first."""
        self._integral = 0.0
        self._last_error: float | None = None
        self._last_t_s = 0.0

    def wheels(self, t_s: float, error_deg: float) -> WheelCommand:
        """Return the wheels for a heading error in [-180, 180), positive when the goal lies clockwise."""
        error = radians(error_deg)
        turn_deg_s = degrees(self._turn_rad_s(t_s, error))
        if abs(error_deg) < self._pivot_beyond_deg:
            return self._turns.wheels(self._cruise_m_s * cos(error), turn_deg_s)
        self._integral = 0.0  # the error during a pivot is no steady offset to learn
        return self._turns.wheels(0.0, turn_deg_s)

    def _turn_rad_s(self, t_s: float, error: float) -> float:
        """Return the PID controller's turn rate, limited."""
        turn = self._p * error
        last_error = self._last_error
        if last_error is not None:
            dt_s = t_s - self._last_t_s
            integral, most = self._integral + error * dt_s, INTEGRAL_MAX_RAD_S
            self._integral = most if integral > most else -most if integral < -most else integral
            turn += self._i * self._integral
            if self._d and dt_s > 0.0:
                turn += self._d * (error - last_error) / dt_s
        self._last_error = error
        self._last_t_s = t_s
        limit = self._turn_limit_rad_s
        return turn if abs(turn) <= limit else copysign(limit, turn)
