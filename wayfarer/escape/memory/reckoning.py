"""Where the rover is in the frame of its memory: dead reckoning along and across the goal heading."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Final

from wayfarer.angles import displacement_m
from wayfarer.escape.api import Anomaly, Observation, Phase

# The stall detector needs this long (DetectorSettings.immobilised_s); what was commanded in that time was not driven.
STALL_S: Final = 0.3


class Reckoning:
    """Follows the rover since ``reset``: ``ahead_m`` along the goal heading, ``right_m`` to the right of it.

    The observation's dead reckoning counts. Where nothing sums it up, as in another robot's loop, the distance covered
    and the phase are used, and the way of a stall is taken back where that distance is only the commanded one.
    """

    def __init__(self, cruise_m_s: float) -> None:
        self._stall_m = STALL_S * cruise_m_s
        self.reset()

    def reset(self) -> None:
        """Begin here."""
        self.ahead_m = self.right_m = 0.0
        self._last: Observation | None = None

    def follow(self, observation: Observation, phase: Phase) -> None:
        """Add one tick in this phase: only ``BACK_OFF`` moves backwards, and a turn on the spot does not move."""
        last, self._last = self._last, observation
        if observation.north_m is not None and observation.east_m is not None:
            goal_rad = radians(observation.goal_heading_deg)
            ahead, aside = cos(goal_rad), sin(goal_rad)
            self.ahead_m = observation.north_m * ahead + observation.east_m * aside
            self.right_m = observation.east_m * ahead - observation.north_m * aside
        elif last is not None and phase is not Phase.TURN_AWAY:
            forward_m = observation.covered_m - last.covered_m
            self._move(observation, -forward_m if phase is Phase.BACK_OFF else forward_m)

    def take_back_stall(self) -> None:
        """Subtract the distance commanded during a stall, if nothing measured it."""
        last = self._last
        if last is None or last.measured_m is not None or last.north_m is not None:
            return
        if Anomaly.IMMOBILISED in last.anomalies:
            self._move(last, -self._stall_m)

    def _move(self, observation: Observation, forward_m: float) -> None:
        ahead_m, right_m = displacement_m(observation.heading_deg - observation.goal_heading_deg, forward_m)
        self.ahead_m += ahead_m
        self.right_m += right_m
