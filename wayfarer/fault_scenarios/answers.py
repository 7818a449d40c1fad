"""What the rover said and did about a fault, and when: found in what a run recorded."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from wayfarer.fault_scenarios.recorder import RecordedTick, RunRecorder
from wayfarer.fault_scenarios.scenario import REACHED, Expectation, Reached
from wayfarer.safety.conditions import LEVELS, Condition
from wayfarer.simhal.faults.kinds import Fault, LoopStall, Lost

ROUNDING_S = 1e-6

_CUT_OFF = {"nack", "hang", "silent"}  # kinds that let no stop through to the motors while they last


class Answer(NamedTuple):
    """Something that the rover said; ``t_s`` on the run's clock, when it was said first."""

    level: Reached
    cause: str
    t_s: float


def answers(monitor: RunRecorder, begun_s: float) -> Iterator[Answer]:
    """Give what the rover said after the fault began: conditions by their level, an error that ended it, events."""
    said = set()
    for moment in monitor.moments:
        for condition in moment.conditions if moment.t_s >= begun_s else ():
            if condition not in said:
                said.add(condition)
                yield Answer(REACHED[LEVELS[condition]], condition.value, moment.t_s)
    if monitor.ended == "failed":
        yield Answer(Reached.FAULT, monitor.ended, monitor.ended_s)
    for t_s, name, _ in monitor.recorded_events:
        if t_s >= begun_s:
            yield Answer(Reached.NOTE, name, t_s)


def counts(answer: Answer, expect: Expectation) -> bool:
    """Tell whether an answer is one to the fault: an event, or what a person did, only where the scenario names it."""
    by_itself = answer.level > Reached.NOTE and answer.cause != Condition.OPERATOR_HOLD.value
    return answer.cause in expect.causes or (not expect.causes and by_itself)


def escape_answer(monitor: RunRecorder, expect: Expectation, begun_s: float) -> RecordedTick | None:
    """Return the first tick at which the escape logic answered as expected."""
    return next((tick for tick in monitor.moments if tick.t_s >= begun_s and tick.why in expect.answer), None)


def stood_s(monitor: RunRecorder, begun_s: float, from_s: float) -> float | None:
    """Return the delay from a time to the first stop command; 0 if the wheels were stopped all the time."""
    ticks = [(moment.t_s, moment.commanded == (0.0, 0.0)) for moment in monitor.moments]
    stood = sorted(each for each in (*ticks, *monitor.stood_still_s) if each[0] >= begun_s)
    if all(still for t_s, still in stood if t_s <= from_s):
        return 0.0
    return next((t_s - begun_s for t_s, still in stood if still and t_s >= from_s - ROUNDING_S), None)


def tripped_s(monitor: RunRecorder, begun_s: float) -> float | None:
    """Return when the wheels stood although no stop could get through to them: then it was the board's own deadman."""
    cuts = [(from_s, from_s + _cuts_for_s(fault)) for from_s, fault, begins in monitor.faults if begins]
    times_s = (t_s for t_s, still in monitor.stood_still_s if still and t_s >= begun_s)
    return next((t_s for t_s in times_s if any(from_s < t_s <= to_s for from_s, to_s in cuts)), None)


def _cuts_for_s(fault: Fault) -> float:
    """Return for how long a fault lets no stop through to the wheels."""
    if isinstance(fault.params, LoopStall):
        return fault.params.by_s
    sure = not isinstance(fault.params, Lost) or fault.params == Lost()
    return fault.for_s if fault.target == "motors" and fault.kind in _CUT_OFF and sure else 0.0
