"""Decides from the simulated world when a trial ends, and how; in a field trial, when a person helps the rover.

``TrialCounters`` counts what the rover itself reports. ``trial.outcome_of`` adds the rover's own reasons for ending.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Final, Literal, get_args

from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Phase
from wayfarer.safety.conditions import Condition
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.simhal.world.simulated_world import SimulatedWorld

Outcome = Literal["escaped", "left_bounds", "entrapped", "tipped", "fault"]
OUTCOMES: Final = get_args(Outcome)
LOST: Final[Outcome] = "entrapped"
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

# Looking up a member of an Enum through its class is slow.
_HALT: Final = Phase.HALT
_FOLLOW: Final = Phase.FOLLOW
_BACK_OFF: Final = Phase.BACK_OFF
_RESTING: Final = Condition.RESTING


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
        # Kept here: a constant of a module that is not compiled is looked up at each step.
        self._goal_y_m, self._size_m = forest.goal_y_m, WORLD_SIZE_M
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
            and 0.0 <= x_m <= self._size_m
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
        if not (0.0 <= world.x_m <= self._size_m and world.y_m >= 0.0):
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


class TrialCounters(RunLog):
    """A run log that counts and keeps nothing.

    ``finish`` is called when the rover has disarmed itself: nobody is there to arm it again, so the trial is over. With
    ``ends_lost`` it is also over when the rover begins its first rest: it has tried the whole ladder
    (``escape.recovery``) without progress.
    """

    def __init__(self, *, ends_lost: bool = False) -> None:
        self._ends_lost = ends_lost
        self.finish: Callable[[str, str], None] = lambda _reason, _text: None
        self.ticks = 0
        self.anomalies = 0
        self.episodes = 0
        self.why_disarmed: object = None
        self._phase = _HALT

    def tick(self, record: TickRecord) -> None:
        """Count the tick, and each phase that an anomaly began."""
        self.ticks += 1
        if self._ends_lost and record.conditions and _RESTING in record.conditions:
            self.finish(LOST, "tried the whole ladder without progress")
        phase = record.decision.phase
        if phase is not self._phase:
            self._count(phase)

    def _count(self, phase: Phase) -> None:
        if phase is _BACK_OFF:
            self.anomalies += 1
            self.episodes += self._phase is _FOLLOW
        self._phase = phase

    def event(self, name: str, t_s: float, **details: object) -> None:  # noqa: ARG002
        """End the trial of a rover that gave up by itself."""
        if name == "disarmed":
            self.why_disarmed = details["reason"]
            self.finish(name, str(self.why_disarmed))
