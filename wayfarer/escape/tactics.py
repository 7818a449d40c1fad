"""Tactics: small objects with a memory that may change the plan at an anomaly; ``catalogue`` combines them.

The ten algorithms of the paper respond to each anomaly by what they observe at that moment (``policies``). A tactic has
a memory. It is called at each anomaly, after those choices, and may change the ``EscapePlan``: turn angle, back-off,
length of the straight, radius of the probe's arc, and whether a heading that is back at the goal heading ends the
episode. Its input is what every blind rover has: the compass, the fact that there is an anomaly, and dead reckoning. It
cannot make a phase unbounded: each phase has bounds for every plan.

Numbers without another source are from ``docs/explanation/better-escape.md`` (even layouts of the reference forests).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import cos, exp, inf, radians, sin
from typing import Final, NamedTuple, Protocol

from wayfarer.angles import displacement_m
from wayfarer.escape.api import Anomaly, Observation, Phase
from wayfarer.escape.manoeuvres import EscapePlan

# The stall detector needs this long (DetectorSettings.immobilised_s); what was commanded in that time was not driven.
STALL_S: Final = 0.3
# The slope of the ground is the mean pitch of about this time; a stall is found in a third of it.
SETTLE_S: Final = 1.0


class Reckoning:
    """What tactics know of the rover's way since ``reset``.

    ``ahead_m`` along the goal heading and ``right_m`` to the right of it are dead reckoning. ``risen_deg`` is how far
    the nose is above the slope of the ground: a rover that pushes onto a trunk pitches up, one whose wheels spin does
    not.
    """

    def __init__(self, cruise_m_s: float) -> None:
        self._stall_m = STALL_S * cruise_m_s
        self.reset()

    def reset(self) -> None:
        """Begin here; the next observation is level."""
        self.ahead_m = self.right_m = self.risen_deg = 0.0
        self._last: Observation | None = None
        self._ground_deg = 0.0

    def follow(self, observation: Observation, phase: Phase) -> None:
        """Add one tick in this phase: only ``BACK_OFF`` moves backwards, and a turn on the spot does not move."""
        last, self._last = self._last, observation
        if last is None:
            self._ground_deg = observation.pitch_deg
            return
        if observation.north_m is not None and observation.east_m is not None:
            goal_rad = radians(observation.goal_heading_deg)
            ahead, aside = cos(goal_rad), sin(goal_rad)
            self.ahead_m = observation.north_m * ahead + observation.east_m * aside
            self.right_m = observation.east_m * ahead - observation.north_m * aside
        elif phase is not Phase.TURN_AWAY:
            forward_m = observation.covered_m - last.covered_m
            self._move(observation, -forward_m if phase is Phase.BACK_OFF else forward_m)
        share = 1.0 - exp((last.t_s - observation.t_s) / SETTLE_S)
        self._ground_deg += (observation.pitch_deg - self._ground_deg) * share
        self.risen_deg = observation.pitch_deg - self._ground_deg

    def take_back_stall(self) -> None:
        """Subtract the distance commanded during a stall, if no motion sensor measured the distance."""
        last = self._last
        if last is None or last.measured_m is not None or last.north_m is not None:
            return
        if Anomaly.IMMOBILISED in last.anomalies:
            self._move(last, -self._stall_m)

    def _move(self, observation: Observation, forward_m: float) -> None:
        ahead_m, right_m = displacement_m(observation.heading_deg - observation.goal_heading_deg, forward_m)
        self.ahead_m += ahead_m
        self.right_m += right_m


class AnomalyContext(NamedTuple):
    """An anomaly, as a tactic sees it.

    ``nose_up_deg`` is how far the nose has risen above the slope of the ground. ``bearing_deg`` is the heading relative
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


RETRY_AFTER_M: Final = 0.9  # commanded since the last anomaly
BACK_OFF_SHARE: Final = 0.67  # 0.1 m with the measures of the paper's simulator


class PlanScaling:
    """Scales the plan: each measure is a multiple of that in the rover file, so that it still fits the rover."""

    def __init__(self, *, turn: float = 1.0, straight: float = 1.0, radius: float = 1.0) -> None:
        self._turn, self._straight, self._radius = turn, straight, radius

    def reset(self) -> None:
        pass  # there is nothing to forget

    def plan(self, _context: AnomalyContext, escape_plan: EscapePlan) -> None:
        escape_plan.turn_deg *= self._turn
        escape_plan.straight_m *= self._straight
        escape_plan.radius_m *= self._radius


# A rover that pushes onto a trunk for the 0.3 s of a stall raises its nose by some 8 degrees; a compass's own noise is
# far below a degree.
NOSE_UP_DEG: Final = 3.0


def on_the_way(context: AnomalyContext) -> bool:
    """Return whether the rover was following its goal; during an episode, along a wall, contacts are expected."""
    return context.new_episode


def nose_level(context: AnomalyContext) -> bool:
    """Return whether the nose did not rise: nothing that can be climbed is ahead."""
    return context.nose_up_deg < NOSE_UP_DEG


class RetryAhead:
    """After a free run, back off only a little, and retry straight ahead where ``worth`` says so: a slip is over then.

    If there is an obstacle after all, the rover meets it again within ``RETRY_AFTER_M``, and then responds as usual. So
    a wall costs one stall and one back-off more, and a slip costs neither an arc nor drift to one side. The back-off is
    shorter because every metre backwards is driven twice, and a body needs less room than the usual distance to turn on
    the spot. If it was too short, the next back-off is the usual one.
    """

    def __init__(self, worth: Callable[[AnomalyContext], bool]) -> None:
        self._worth = worth
        self.reset()

    def reset(self) -> None:
        self._last_m = -inf

    def plan(self, context: AnomalyContext, escape_plan: EscapePlan) -> None:
        free = context.travelled_m - self._last_m > RETRY_AFTER_M
        self._last_m = context.travelled_m
        if free and not context.blocked_turns:
            escape_plan.back_off_m *= BACK_OFF_SHARE
            if self._worth(context):
                escape_plan.turn_deg = 0.0


# Two anomalies count as the same if they are in the same cell of 1 m and the same octant of heading. Three such among
# the last 80 are a loop. Then strict Pledge is used for 30 anomalies (the design of the field survey).
CELL_M: Final = 1.0
OCTANT_DEG: Final = 45.0
REMEMBERED: Final = 80
LOOP: Final = 3
STRICT: Final = 30


class LoopGuard:
    """Take back every turn, as strict Pledge does, for some anomalies after the same anomaly was met several times.

    Forest-Pledge ends an episode early when the heading is back at the goal heading. This is shorter on average, but
    circles in a trap shaped like a G. If dead reckoning drifts by more than a cell a lap, a circle is not noticed.
    """

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int, int]] = deque(maxlen=REMEMBERED)
        self._strict = 0

    def reset(self) -> None:
        self._seen.clear()
        self._strict = 0

    def plan(self, context: AnomalyContext, escape_plan: EscapePlan) -> None:
        here = (
            round(context.ahead_m / CELL_M),
            round(context.right_m / CELL_M),
            round(context.bearing_deg / OCTANT_DEG) % 8,
        )
        self._seen.append(here)
        if self._seen.count(here) >= LOOP:
            self._strict = STRICT
            self._seen.clear()
        if self._strict:
            self._strict -= 1
            escape_plan.resets = False
