"""Decides from the simulated world when a trial ends, and how; in a field trial, when a person helps the rover.

``trial.outcome_of`` adds the rover's own reasons for ending.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Final, Literal, get_args

from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.simhal.world.simulated_world import SimulatedWorld

Outcome = Literal["escaped", "left_bounds", "entrapped", "tipped", "fault"]
OUTCOMES: Final = get_args(Outcome)
SUCCESSES: Final = ("escaped", "left_bounds")  # paper, section IV-B: leaving by another edge counts as an escape

# What the log of the run says of each; a trial ends as "fault" by the supervisor, not here.
ENDINGS: Final[Mapping[Outcome, str]] = {
    "escaped": "crossed the destination line",
    "left_bounds": "crossed another edge of the map",
    "entrapped": "used up its path length or its time",
    "tipped": "tipped over",
}

# A rover that is pinned covers no distance; its budget then runs out in time: four times what the whole path budget
# takes at the cruising speed of the abstract forest, 1 m/s.
TIME_PER_BUDGET_S_PER_M: Final = 4.0

# By a person: as far as the rover itself backs off; shorter than any shipped rover, so nothing is jumped over.
PULLED_BACK_M: Final = 0.15


class OutcomeMonitor:
    """Watches a world; ``call_off`` is called once, when the outcome is known.

    A rover that is not out after ``limit_s``, or whose path has used up ``budget_m``, is entrapped.
    """

    def __init__(
        self,
        forest: Forest,
        budget_m: float,
        tip_deg: float,
        call_off: Callable[[str, str], None],
        limit_s: float = inf,
    ) -> None:
        self._goal_y_m = forest.goal_y_m
        self._budget_m = budget_m
        self._budget_s = min(budget_m * TIME_PER_BUDGET_S_PER_M, limit_s)
        self._tip_deg = tip_deg
        self._call_off = call_off
        self.outcome: Outcome | None = None

    def watch(self, world: SimulatedWorld) -> None:
        """Look at the world after a step."""
        x_m, y_m = world.x_m, world.y_m
        if (
            0.0 <= y_m < self._goal_y_m
            and 0.0 <= x_m <= WORLD_SIZE_M
            and world.forward_m + world.reverse_m < self._budget_m
            and world.t_s < self._budget_s
            and abs(world.pitch_deg) < self._tip_deg
            and abs(world.roll_deg) < self._tip_deg
        ):
            return
        if self.outcome is None:
            self.outcome = self._judge(world)
            self._call_off(self.outcome, ENDINGS[self.outcome])

    def _judge(self, world: SimulatedWorld) -> Outcome:
        if world.y_m >= self._goal_y_m:
            return "escaped"
        if not (0.0 <= world.x_m <= WORLD_SIZE_M and world.y_m >= 0.0):
            return "left_bounds"
        tilt_deg = max(abs(world.pitch_deg), abs(world.roll_deg))
        return "tipped" if tilt_deg >= self._tip_deg else "entrapped"

    def path_m(self, world: SimulatedWorld) -> float:
        """Return the path: what was driven, reversing included, and for ``left_bounds`` the way that remains north."""
        remaining_m = max(0.0, self._goal_y_m - world.y_m) if self.outcome == "left_bounds" else 0.0
        return world.path_m + remaining_m


class InterventionCounter:
    """Puts a stuck rover free in a field trial, and counts it; then lets the outcome monitor look.

    The paper, section IV-C: flip-overs and loss of all-wheel contact with the ground made human interventions
    necessary; after one the rover was placed near where it had been stuck, with the same orientation, and the trial
    went on. Here that takes no time, because the paper does not say whether its clock was stopped.
    """

    def __init__(self, tip_deg: float, then: Callable[[SimulatedWorld], None]) -> None:
        self._tip_deg = tip_deg
        self._then = then
        self.flips = 0
        self.high_centred = 0

    @property
    def interventions(self) -> int:
        """How often the rover was helped: turned over, or off its wheels."""
        return self.flips + self.high_centred

    def watch(self, world: SimulatedWorld) -> None:
        """Put a rover back on its wheels."""
        flipped = abs(world.pitch_deg) >= self._tip_deg or abs(world.roll_deg) >= self._tip_deg
        if flipped or world.high_centred:
            self.flips += flipped
            self.high_centred += not flipped
            world.pull_back(PULLED_BACK_M)
        self._then(world)
