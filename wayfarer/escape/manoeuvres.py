"""The manoeuvres, one per phase: its wheel commands, and the event that ends it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import inf, radians
from typing import ClassVar, Final

from wayfarer.angles import DEG_PER_RAD, clamp, wrap180
from wayfarer.escape.api import Anomaly, Observation, Phase
from wayfarer.escape.phases import PhaseEvent
from wayfarer.escape.settings import EscapeSettings
from wayfarer.escape.turn_control import BODY_LAG_S, PIVOT_BEYOND_DEG, HeadingControl, TurnController, faded
from wayfarer.hal import Side, WheelCommand

# A manoeuvre may take this much longer, in time and in distance, than its plan before it counts as failed: lag, mud
# and turn slip are part of a normal day. The constant second covers the start from standstill.
SLACK: Final = 3.0
SLACK_S: Final = 1.0
# For any plan: reversing may be blocked behind as well, unnoticed (fault catalogue, fault 58).
BACK_OFF_MAX_S: Final = 3.0
TURN_MIN_DEG_S: Final = 30.0  # the slowest turn on the spot, near the end of its angle


@dataclass(slots=True)
class EscapePlan:
    """What an episode carries from one manoeuvre to the next.

    ``counter_deg`` is the paper's C: the heading gained since the episode began, clockwise positive, any number of
    turns. ``side`` is the turn direction tau (+1 clockwise), ``turn_deg`` the turn angle theta; ``unturned_deg`` is
    what a finished turn left to its probe, clockwise positive. ``resets`` says whether a heading that is back at the
    goal heading ends the episode.
    """

    side: int = 1
    turn_deg: float = 0.0
    back_off_m: float = 0.0
    stride_m: float = 0.0
    counter_deg: float = 0.0
    unturned_deg: float = 0.0
    resets: bool = False


_NOTHING: Final[frozenset[Anomaly]] = frozenset()
_LIFTED_BEHIND: Final = frozenset({Anomaly.NOSE_DOWN})


class Manoeuvre(ABC):
    """Runs one phase: call ``begin``, then ``event`` and ``wheels`` once per tick until ``event`` returns an event."""

    phase: ClassVar[Phase]

    def __init__(self, settings: EscapeSettings, turns: TurnController, escape_plan: EscapePlan) -> None:
        self._settings = settings
        # What is asked in each tick: settings are not compiled.
        self._cruise_m_s, self._reverse_m_s = settings.cruise_m_s, settings.reverse_m_s
        self._turn_deg_s, self._heading_p = settings.turn_deg_s, settings.heading_p
        self._probe_radius_m = settings.probe_radius_m
        self._turns = turns
        self._escape_plan = escape_plan
        self._limit_t_s = inf
        self._limit_m = inf
        self._known = _NOTHING

    @abstractmethod
    def begin(self, observation: Observation) -> None:
        """Start at this observation."""

    @abstractmethod
    def event(self, observation: Observation) -> PhaseEvent | None:
        """Return what ends the manoeuvre now, or None to continue."""

    @abstractmethod
    def wheels(self, observation: Observation) -> WheelCommand:
        """Return the wheels for this tick."""

    def _bound(self, observation: Observation, time_s: float, distance_m: float = inf) -> None:
        """Set the bounds of the manoeuvre: the planned time and commanded distance with slack, from now on."""
        self._limit_t_s = observation.t_s + time_s * SLACK + SLACK_S
        self._limit_m = observation.travelled_m + distance_m * SLACK

    def _exhausted(self, observation: Observation) -> bool:
        return observation.t_s >= self._limit_t_s or observation.travelled_m >= self._limit_m

    def _fresh(self, observation: Observation) -> tuple[Anomaly, ...]:
        """Return the anomalies that are new since the manoeuvre began; one that had cleared is new again."""
        if not observation.anomalies:
            self._known = _NOTHING
            return ()
        self._known &= frozenset(observation.anomalies)
        return tuple(anomaly for anomaly in observation.anomalies if anomaly not in self._known)

    def _drive_ahead(self, observation: Observation) -> None:
        """Begin to drive ahead: a nose that is down already was lifted from behind, and driving ahead frees it."""
        self._known = frozenset(observation.anomalies) & _LIFTED_BEHIND


def _ahead(observation: Observation) -> bool:
    """Return whether an anomaly concerns driving ahead: a touch only at the rear, left from backing off, does not."""
    contact = observation.contact
    if contact is None or contact.sides != _BEHIND:
        return True
    return observation.anomalies != _ONLY_TOUCHED


_BEHIND: Final = (Side.REAR,)
_ONLY_TOUCHED: Final = (Anomaly.TOUCHED,)


class Follow(Manoeuvre):
    """Hold the goal heading. Runs out when turning towards the goal takes too long: something holds the body."""

    phase = Phase.FOLLOW

    def begin(self, observation: Observation) -> None:
        self._heading = HeadingControl(self._settings, self._turns)
        self._drive_ahead(observation)
        self._pivot_s = 180.0 / self._turn_deg_s
        self._bound(observation, self._pivot_s)

    def event(self, observation: Observation) -> PhaseEvent | None:
        if self._fresh(observation) and _ahead(observation):
            return PhaseEvent.ANOMALY
        if self._turns.blocked:
            return PhaseEvent.EXHAUSTED
        if observation.t_s >= self._limit_t_s:
            error_deg = wrap180(observation.goal_heading_deg - observation.heading_deg)
            if abs(error_deg) >= PIVOT_BEYOND_DEG:
                return PhaseEvent.EXHAUSTED
            self._bound(observation, self._pivot_s)
        return None

    def wheels(self, observation: Observation) -> WheelCommand:
        error_deg = wrap180(observation.goal_heading_deg - observation.heading_deg)
        return self._heading.wheels(observation.t_s, error_deg)


class BackOff(Manoeuvre):
    """Reverse straight. Anomalies that were there at its start do not count; being blocked behind does.

    The body follows its wheels with a lag, so it rolls on after their stop. That is part of the planned distance.
    """

    phase = Phase.BACK_OFF

    def begin(self, observation: Observation) -> None:
        distance_m = self._escape_plan.back_off_m
        self._known = frozenset(observation.anomalies)
        self._from_m, self._commanded_from_m = observation.covered_m, observation.travelled_m
        self._t_s, self._commanded_m, self._roll_m = observation.t_s, 0.0, 0.0
        self._bound(observation, distance_m / self._reverse_m_s, distance_m)
        self._limit_t_s = min(self._limit_t_s, observation.t_s + BACK_OFF_MAX_S)

    def event(self, observation: Observation) -> PhaseEvent | None:
        if self._stops_after_m(observation) >= self._escape_plan.back_off_m:
            return PhaseEvent.DONE
        # Whether reversing met something; a touch counts only behind, the front may still be clearing.
        if observation.contact is not None and Side.REAR in observation.contact.sides:
            blocked = Anomaly.TOUCHED in observation.anomalies
        else:
            blocked = any(anomaly is not Anomaly.TOUCHED for anomaly in self._fresh(observation))
        if blocked:
            return PhaseEvent.ANOMALY
        return PhaseEvent.EXHAUSTED if self._exhausted(observation) else None

    def _stops_after_m(self, observation: Observation) -> float:
        """Return how far back the body will be if its wheels stop now: at most as far as it was commanded.

        The roll is what was commanded and not driven yet. A body that has moved less than its wheels rolls less. Half a
        tick's way is added, so that the wheels stop at the tick that is nearest to the plan, not at the next one. A
        tick is no longer than half the lag: more is a gap between two calls.
        """
        dt_s, self._t_s = observation.t_s - self._t_s, observation.t_s
        commanded_m = observation.travelled_m - self._commanded_from_m
        step_m, self._commanded_m = commanded_m - self._commanded_m, commanded_m
        self._roll_m = faded(self._roll_m + step_m, dt_s, BODY_LAG_S)
        covered_m, driven_m = observation.covered_m - self._from_m, commanded_m - self._roll_m
        roll_m = self._roll_m * covered_m / driven_m if 0.0 <= covered_m < driven_m else self._roll_m
        tick_m = min(step_m, self._reverse_m_s * BODY_LAG_S / 2.0)
        return min(covered_m + roll_m, commanded_m) + tick_m / 2.0

    def wheels(self, _observation: Observation) -> WheelCommand:
        return self._turns.wheels(-self._reverse_m_s, 0.0)


class TurnAway(Manoeuvre):
    """Turn on the spot to the side and by the angle of the escape plan. A blocked turn runs out of time.

    The rate falls with the angle that is left, because a skid-steered body does not stop turning at once.
    """

    phase = Phase.TURN_AWAY

    def begin(self, observation: Observation) -> None:
        escape_plan = self._escape_plan
        self._known = frozenset(observation.anomalies)
        self._until_deg = escape_plan.counter_deg + escape_plan.side * escape_plan.turn_deg
        escape_plan.unturned_deg = 0.0
        self._bound(observation, escape_plan.turn_deg / self._turn_deg_s)

    def event(self, observation: Observation) -> PhaseEvent | None:
        left_deg = self._left_deg
        if left_deg <= self._settings.turn_within_deg:
            self._escape_plan.unturned_deg = left_deg * self._escape_plan.side
            return PhaseEvent.DONE
        if self._fresh(observation):
            # Backing off once more does not help against what is behind: that turn is over.
            return PhaseEvent.ANOMALY if _ahead(observation) else PhaseEvent.EXHAUSTED
        return PhaseEvent.EXHAUSTED if self._turns.blocked or self._exhausted(observation) else None

    def wheels(self, _observation: Observation) -> WheelCommand:
        rate_deg_s = clamp(self._left_deg * self._settings.turn_p, TURN_MIN_DEG_S, self._turn_deg_s)
        return self._turns.wheels(0.0, self._escape_plan.side * rate_deg_s)

    @property
    def _left_deg(self) -> float:
        return (self._until_deg - self._escape_plan.counter_deg) * self._escape_plan.side


class Probe(Manoeuvre):
    """Drive straight for a body length or so, then curve back against the turn until the counter is unwound.

    The heading to be held is a function of the distance covered, so that the curve has its radius on any ground.
    """

    phase = Phase.PROBE

    def begin(self, observation: Observation) -> None:
        escape_plan, straight_m, radius_m = self._escape_plan, self._settings.probe_straight_m, self._probe_radius_m
        self._drive_ahead(observation)
        self._heading_deg = observation.heading_deg + escape_plan.unturned_deg
        self._curve_from_m = observation.covered_m + straight_m
        distance_m = straight_m + radians(abs(escape_plan.counter_deg)) * radius_m
        speed_m_s = self._turns.curve_speed_m_s(self._cruise_m_s, radius_m)
        self._bound(observation, distance_m / speed_m_s, distance_m)

    def event(self, observation: Observation) -> PhaseEvent | None:
        if self._fresh(observation) and _ahead(observation):
            return PhaseEvent.ANOMALY
        escape_plan = self._escape_plan
        if escape_plan.counter_deg * escape_plan.side <= 0.0:
            return PhaseEvent.UNWOUND
        error_deg = wrap180(observation.goal_heading_deg - observation.heading_deg)
        if escape_plan.resets and abs(error_deg) <= self._settings.reset_within_deg:
            return PhaseEvent.REALIGNED
        if self._turns.blocked:
            return PhaseEvent.ANOMALY  # something holds it: the counter must not be lost to a new episode
        return PhaseEvent.EXHAUSTED if self._exhausted(observation) else None

    def wheels(self, observation: Observation) -> WheelCommand:
        speed_m_s, curve_deg, curve_deg_s = self._cruise_m_s, 0.0, 0.0
        curved_m = observation.covered_m - self._curve_from_m
        if curved_m > 0.0:
            speed_m_s = self._turns.curve_speed_m_s(speed_m_s, self._probe_radius_m)
            deg_per_m = self._escape_plan.side / self._probe_radius_m * DEG_PER_RAD
            curve_deg, curve_deg_s = curved_m * deg_per_m, speed_m_s * deg_per_m
        error_deg = wrap180(self._heading_deg - curve_deg - observation.heading_deg)
        turn_deg_s = self._heading_p * error_deg - curve_deg_s
        return self._turns.wheels(speed_m_s, clamp(turn_deg_s, -self._turn_deg_s, self._turn_deg_s))


class Stride(Manoeuvre):
    """Drive straight for the escape plan's stride, on the heading at which the stride began."""

    phase = Phase.STRIDE

    def begin(self, observation: Observation) -> None:
        stride_m = self._escape_plan.stride_m
        self._heading = HeadingControl(self._settings, self._turns)
        self._drive_ahead(observation)
        self._heading_deg = observation.heading_deg
        self._until_m = observation.covered_m + stride_m
        self._bound(observation, stride_m / self._cruise_m_s, stride_m)

    def event(self, observation: Observation) -> PhaseEvent | None:
        if self._fresh(observation) and _ahead(observation):
            return PhaseEvent.ANOMALY
        if observation.covered_m >= self._until_m:
            return PhaseEvent.DONE
        return PhaseEvent.EXHAUSTED if self._turns.blocked or self._exhausted(observation) else None

    def wheels(self, observation: Observation) -> WheelCommand:
        return self._heading.wheels(observation.t_s, wrap180(self._heading_deg - observation.heading_deg))


MANOEUVRES: Final[tuple[type[Manoeuvre], ...]] = (Follow, BackOff, TurnAway, Probe, Stride)
