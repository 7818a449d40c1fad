"""Position and slope for tactics: dead reckoning over short distances, and pitch relative to the ground."""

from __future__ import annotations

from math import exp
from typing import Final

from wayfarer.angles import displacement_m
from wayfarer.escape.api import Anomaly, Observation, Phase

# The stall detector needs this long (DetectorSettings.immobilised_s); what was commanded in that time was not driven.
STALL_S: Final = 0.3


class Reckoning:
    """Position of the rover since ``reset``: ``ahead_m`` along the goal heading, ``right_m`` to the right of it."""

    def __init__(self, cruise_m_s: float) -> None:
        self._stall_m = STALL_S * cruise_m_s
        self.reset()

    def reset(self) -> None:
        """Begin here."""
        self.ahead_m = self.right_m = 0.0
        self._last_m: float | None = None

    def follow(self, observation: Observation, phase: Phase) -> None:
        """Add one tick in this phase: only ``BACK_OFF`` moves backwards, and a turn on the spot does not move."""
        last_m, self._last_m = self._last_m, observation.covered_m
        if last_m is not None and phase is not Phase.TURN_AWAY:
            forward_m = observation.covered_m - last_m
            self._move(observation, -forward_m if phase is Phase.BACK_OFF else forward_m)

    def take_back_stall(self, observation: Observation) -> None:
        """Subtract the distance commanded during a stall, if no motion sensor measured the distance."""
        if observation.measured_m is None and Anomaly.IMMOBILISED in observation.anomalies:
            self._move(observation, -self._stall_m)

    def _move(self, observation: Observation, forward_m: float) -> None:
        ahead_m, right_m = displacement_m(observation.heading_deg - observation.goal_heading_deg, forward_m)
        self.ahead_m += ahead_m
        self.right_m += right_m


# The slope of the ground is the mean pitch of about this time; a stall is found in a third of it.
SETTLE_S: Final = 1.0


class PitchBaseline:
    """Follows the pitch of the ground; ``risen_deg`` is how far the nose is above it.

    A rover that pushes onto a trunk pitches up; one whose wheels spin stays level.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the ground: the next observation is level."""
        self._ground_deg: float | None = None
        self._last_t_s = 0.0
        self.risen_deg = 0.0

    def follow(self, observation: Observation) -> None:
        """Take one tick."""
        pitch_deg = observation.pitch_deg
        if self._ground_deg is None:
            self._ground_deg, self._last_t_s = pitch_deg, observation.t_s
        share = 1.0 - exp((self._last_t_s - observation.t_s) / SETTLE_S)
        self._ground_deg += (pitch_deg - self._ground_deg) * share
        self._last_t_s = observation.t_s
        self.risen_deg = pitch_deg - self._ground_deg
