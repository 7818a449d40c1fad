"""Pitch relative to level ground: a rover that pushes onto a trunk pitches up, one with spinning wheels stays level."""

from __future__ import annotations

from math import exp

from wayfarer.escape.api import Observation

# The ground's own slope is what the pitch has been for about so long; a stall is found in a third of it.
SETTLE_S = 1.0


class PitchBaseline:
    """Follows the pitch of the ground; ``risen_deg`` is how far the nose is above it."""

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
