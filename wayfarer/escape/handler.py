"""The escape handler: runs the manoeuvres of one algorithm over the phase table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import Final

from mypy_extensions import mypyc_attr

from wayfarer.escape.api import CLOCKWISE, Decision, Observation, Phase
from wayfarer.escape.manoeuvres import MANOEUVRES, EscapePlan
from wayfarer.escape.phases import WHY, PhaseEvent, Transitions
from wayfarer.escape.settings import EscapeSettings, Vehicle
from wayfarer.escape.turn_control import TurnController

# After this many blocked turns in a row, turns alternate between the sides, beginning with the other side: a body that
# is wedged can still turn back the way it came, and robot mowers that repeat a failed turn dig themselves in.
BLOCKED_TURNS_BEFORE_ALTERNATING: Final = 2
# Shares of the back-off distance, by the number of blocked turns: between two trunks a body turns best in the middle.
BACK_OFF_SHARES: Final = (1.0, 0.5, 0.25)

# Blocked turns are forgotten after following the goal for more than this distance, because that is another place.
FREE_RUN_M: Final = 1.0
# A counter beyond this is forgotten (fault catalogue, fault 59).
COUNTER_MAX_DEG: Final = 1080.0


# The choices in which algorithms differ (``catalogue``); a side is the sign of the turn.
TurnSide = Callable[[Observation, EscapeSettings, Random], int]
TurnAngle = Callable[[Observation, EscapeSettings, Random], float]
StrideLength = Callable[[EscapeSettings, Random], float]


def short_stride(settings: EscapeSettings, _rng: Random) -> float:
    """Return the fixed stride of the reactive algorithms, in metres."""
    return settings.react_stride_m


@dataclass(frozen=True, slots=True)
class AlgorithmSpec:
    """What makes one algorithm out of the common handler.

    ``keeps_side`` keeps the turn direction for a whole episode, as Pledge must; otherwise it is chosen at each anomaly.
    """

    transitions: Transitions
    side: TurnSide
    angle: TurnAngle
    stride: StrideLength = short_stride
    resets: bool = False
    keeps_side: bool = False


@mypyc_attr(allow_interpreted_subclasses=True)
class PhasedHandler:
    """Decides one tick at a time; implements ``EscapeHandler``."""

    def __init__(self, spec: AlgorithmSpec, settings: EscapeSettings, vehicle: Vehicle, rng: Random) -> None:
        self._spec = spec
        self._settings = settings
        self._rng = rng
        self._escape_plan = EscapePlan(resets=spec.resets)
        self._turns = TurnController(vehicle)
        self._manoeuvres = {kind.phase: kind(settings, self._turns, self._escape_plan) for kind in MANOEUVRES}
        self.reset()

    def reset(self) -> None:
        """Forget everything; see ``EscapeHandler``."""
        self._phase, self._phase_name = Phase.FOLLOW, Phase.FOLLOW.value
        self._manoeuvre = self._manoeuvres[Phase.FOLLOW]
        self._begun = False
        self._side = self._escape_plan.side = CLOCKWISE
        self._escape_plan.counter_deg = self._escape_plan.turn_deg = 0.0
        self._followed_from_m = 0.0
        self._episodes = 0
        self._blocked_turns = 0
        self._turns.reset()

    def decide(self, observation: Observation) -> Decision:
        """Return the decision for this tick; see ``EscapeHandler``."""
        # The counter follows the compass, through wrap-around and however a turn came about.
        turned_deg = self._turns.observe(observation.t_s, observation.heading_deg, observation.applied)
        self._escape_plan.counter_deg += turned_deg
        if pending_deg := self._turns.lag.pending_deg:
            observation = observation._replace(heading_deg=(observation.heading_deg + pending_deg) % 360.0)
        if not self._begun:
            self._begun = True
            self._followed_from_m = observation.travelled_m
            self._turns.begin_manoeuvre()
            self._manoeuvre.begin(observation)
        manoeuvre = self._manoeuvre
        event = (
            PhaseEvent.OVERWOUND
            if abs(self._escape_plan.counter_deg) > COUNTER_MAX_DEG
            else manoeuvre.event(observation)
        )
        if event is None:
            return Decision(manoeuvre.wheels(observation), self._phase, self._phase_name)
        why = WHY[self._phase, event]
        self._enter(self._spec.transitions[self._phase, event], event, observation)
        return Decision(self._manoeuvre.wheels(observation), self._phase, why)

    def memory(self) -> Mapping[str, float | str]:
        """Return the inner state for the log and for replay."""
        escape_plan = self._escape_plan
        return {
            "counter_deg": round(escape_plan.counter_deg, 3),
            "side": escape_plan.side,
            "turn_deg": round(escape_plan.turn_deg, 3),
            "episodes": self._episodes,
            "blocked_turns": self._blocked_turns,
            "turn_from_duty": round(self._turns.dead_zone, 3),
        }

    def _enter(self, phase: Phase, event: PhaseEvent, observation: Observation) -> None:
        left, self._phase, self._phase_name = self._phase, phase, phase.value
        if left is Phase.TURN_AWAY:
            self._blocked_turns = 0 if event is PhaseEvent.DONE else self._blocked_turns + 1
            self._escape_plan.side = self._side
        if event is PhaseEvent.OVERWOUND:
            self._escape_plan.counter_deg = 0.0
        if phase is Phase.FOLLOW:
            self._followed_from_m = observation.travelled_m
        elif phase is Phase.BACK_OFF:
            self._plan(observation, new_episode=left is Phase.FOLLOW)
        self._manoeuvre = self._manoeuvres[phase]
        self._turns.begin_manoeuvre()
        self._manoeuvre.begin(observation)

    def _plan(self, observation: Observation, *, new_episode: bool) -> None:
        """Choose side, angle and stride for the anomaly that was just met."""
        spec, escape_plan = self._spec, self._escape_plan
        if new_episode:
            self._episodes += 1
            escape_plan.counter_deg = 0.0
            if observation.travelled_m - self._followed_from_m > FREE_RUN_M:
                self._blocked_turns = 0
        if new_episode or not spec.keeps_side:
            self._side = spec.side(observation, self._settings, self._rng)
        settings = self._settings
        escape_plan.back_off_m = settings.back_off_m * BACK_OFF_SHARES[self._blocked_turns % len(BACK_OFF_SHARES)]
        escape_plan.turn_deg = spec.angle(observation, settings, self._rng)
        escape_plan.stride_m = spec.stride(settings, self._rng)
        escape_plan.side = self._side
        too_often = self._blocked_turns - BLOCKED_TURNS_BEFORE_ALTERNATING
        if too_often >= 0 and too_often % 2 == 0:
            escape_plan.side = -self._side
