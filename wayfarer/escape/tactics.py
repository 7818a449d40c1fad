"""Tactics: small objects with a memory that may change the plan at an anomaly; ``catalogue`` combines them.

The ten algorithms of the paper answer each anomaly from what they see at that moment (``policies``). A tactic
remembers: it is asked at each anomaly, after those choices, and may change the plan that is in the ``EscapePlan``: turn
angle, back-off, length of the straight, radius of the probe's arc, and whether a heading back at the goal ends the
episode. It sees what any blind rover has: the compass, that something is wrong, and dead reckoning from commands. It
cannot prolong anything: phases keep their bounds, whatever is planned.

Numbers without another source are from ``docs/better-escape.md``, found on the even layouts of the reference forests.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple, Protocol

from wayfarer.escape.manoeuvres import EscapePlan


class AnomalyContext(NamedTuple):
    """An anomaly, as a tactic sees it.

    ``nose_up_deg`` is how far the nose has risen over the slope of the ground. ``bearing_deg`` is the heading relative
    to the goal, in [-180, 180), clockwise positive; ``ahead_m`` and ``right_m`` are dead reckoning along and across the
    goal heading since the mission began; ``travelled_m`` is the distance commanded; ``blocked_turns`` counts turns in a
    row that something stopped.
    """

    new_episode: bool
    nose_up_deg: float
    bearing_deg: float
    ahead_m: float
    right_m: float
    travelled_m: float
    blocked_turns: int


class Tactic(Protocol):
    """Changes plans; created for each handler."""

    def reset(self) -> None:
        """Forget everything: a new mission begins."""

    def plan(self, context: AnomalyContext, escape_plan: EscapePlan) -> None:
        """Change the plan for this anomaly."""


class PlanScaling:
    """Plan in other measures: each a multiple of what the rover file says, so that it still fits the rover."""

    def __init__(self, *, turn: float = 1.0, back_off: float = 1.0, straight: float = 1.0, radius: float = 1.0) -> None:
        self._turn, self._back_off, self._straight, self._radius = turn, back_off, straight, radius

    def reset(self) -> None:
        """See ``Tactic``; there is nothing to forget."""

    def plan(self, _context: AnomalyContext, escape_plan: EscapePlan) -> None:
        """See ``Tactic``."""
        escape_plan.turn_deg *= self._turn
        escape_plan.back_off_m *= self._back_off
        escape_plan.straight_m *= self._straight
        escape_plan.radius_m *= self._radius


class ShortBackOff:
    """Back off by a share of the usual distance after a free run, and by another one where something is met again.

    Every metre backwards is driven twice. A slip is over as soon as the wheels pull back, and a body needs less room
    than the usual distance to turn on the spot; where it was too little, the next one is longer.
    """

    def __init__(self, *, first: float, again: float, free_run_m: float) -> None:
        self._first, self._again, self._free_run_m = first, again, free_run_m
        self.reset()

    def reset(self) -> None:
        """See ``Tactic``."""
        self._last_m = -inf

    def plan(self, context: AnomalyContext, escape_plan: EscapePlan) -> None:
        """See ``Tactic``."""
        free = context.travelled_m - self._last_m > self._free_run_m
        self._last_m = context.travelled_m
        escape_plan.back_off_m *= self._first if free and not context.blocked_turns else self._again


# A rover that pushes onto a trunk for the 0.3 s of a stall raises its nose by some 8 degrees; a compass's own noise is
# far below a degree.
NOSE_UP_DEG = 3.0


def on_the_way(context: AnomalyContext) -> bool:
    """Tell whether the rover was following its goal: along a wall, contacts are what is to be expected."""
    return context.new_episode


def nose_level(context: AnomalyContext) -> bool:
    """Tell whether the nose did not rise: nothing that can be climbed is ahead."""
    return context.nose_up_deg < NOSE_UP_DEG


class RetryAhead:
    """Back off and go straight on, once after each free run, where it is worth a try: a slip is over then.

    Where something is there after all, it is met again at once, within ``free_run_m`` of commanded distance, and
    answered. A wall costs a stall and a back-off more; a slip costs neither arc nor drift to one side.
    """

    def __init__(self, free_run_m: float, worth: Callable[[AnomalyContext], bool]) -> None:
        self._free_run_m, self._worth = free_run_m, worth
        self.reset()

    def reset(self) -> None:
        """See ``Tactic``."""
        self._last_m = -inf

    def plan(self, context: AnomalyContext, escape_plan: EscapePlan) -> None:
        """See ``Tactic``."""
        free = context.travelled_m - self._last_m > self._free_run_m
        self._last_m = context.travelled_m
        if free and not context.blocked_turns and self._worth(context):
            escape_plan.turn_deg = 0.0
