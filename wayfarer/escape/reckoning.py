"""Dead reckoning over short distances, without lateral motion."""

from __future__ import annotations

from wayfarer.angles import displacement_m
from wayfarer.escape.api import Anomaly, Observation, Phase

# The stall detector needs so long to be sure (DetectorSettings.immobilised_s): what was commanded then was not driven.
STALL_S = 0.3


class Reckoning:
    """Where the rover has come since ``reset``: metres ``ahead_m`` along the goal heading and ``right_m`` of it."""

    def __init__(self, cruise_m_s: float) -> None:
        self._stall_m = STALL_S * cruise_m_s
        self.reset()

    def reset(self) -> None:
        """Begin here."""
        self.ahead_m = self.right_m = 0.0
        self._last_m: float | None = None

    def follow(self, observation: Observation, phase: Phase) -> None:
        """Take one tick, which ended a period of this phase: only ``BACK_OFF`` goes backwards, a turn goes nowhere."""
        last_m, self._last_m = self._last_m, observation.covered_m
        if last_m is not None and phase is not Phase.TURN_AWAY:
            forward_m = observation.covered_m - last_m
            self._move(observation, -forward_m if phase is Phase.BACK_OFF else forward_m)

    def take_back_stall(self, observation: Observation) -> None:
        """Take back what was commanded, and not measured, while driving ahead was found to move nothing."""
        if observation.measured_m is None and Anomaly.IMMOBILISED in observation.anomalies:
            self._move(observation, -self._stall_m)

    def _move(self, observation: Observation, forward_m: float) -> None:
        ahead_m, right_m = displacement_m(observation.heading_deg - observation.goal_heading_deg, forward_m)
        self.ahead_m += ahead_m
        self.right_m += right_m
