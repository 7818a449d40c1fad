"""Interventions in a field trial: puts a stuck rover free, and counts it.

The paper, section IV-C: flip-overs and loss of all-wheel contact with the ground made human interventions necessary;
after one the rover was placed near where it had been stuck, with the same orientation, and the trial went on. Here that
takes no time, because the paper does not say whether its clock was stopped.
"""

from __future__ import annotations

from collections.abc import Callable

from wayfarer.simhal.world.simulated_world import SimulatedWorld

PULLED_BACK_M = 0.15  # as far as the rover itself backs off; shorter than any shipped rover, so nothing is jumped over


class InterventionCounter:
    """Looks at the world after each step, then lets the outcome monitor look."""

    def __init__(self, tip_deg: float, then: Callable[[SimulatedWorld], None]) -> None:
        self._tip_deg = tip_deg
        self._then = then
        self.flips = 0
        self.hangs = 0

    @property
    def interventions(self) -> int:
        """How often the rover was helped: turned over, or off its wheels."""
        return self.flips + self.hangs

    def watch(self, world: SimulatedWorld) -> None:
        """Put a rover back on its wheels."""
        flipped = abs(world.pitch_deg) >= self._tip_deg or abs(world.roll_deg) >= self._tip_deg
        if flipped or world.hangs:
            self.flips += flipped
            self.hangs += not flipped
            world.pull_back(PULLED_BACK_M)
        self._then(world)
