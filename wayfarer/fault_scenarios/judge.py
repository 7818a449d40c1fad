"""Judges a scenario: did the fault take effect, how severe was the response, and how long did it take."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import NamedTuple

from wayfarer.fault_scenarios.expectations import violations
from wayfarer.fault_scenarios.first_difference import FaultEffect, first_difference
from wayfarer.fault_scenarios.recorder import RunRecorder
from wayfarer.fault_scenarios.result import Result, Tried
from wayfarer.fault_scenarios.runner import RunResult
from wayfarer.fault_scenarios.scenario import Expectation, Reached, Scenario
from wayfarer.safety.conditions import LEVELS, Condition, Level
from wayfarer.simhal.faults.kinds import Fault, LoopStall, Lost

ROUNDING_S = 1e-6
STOOD_ALREADY = "the wheels were stopped already"

_LEVELS = {
    Level.NOTE: Reached.NOTE,
    Level.DEGRADE: Reached.DEGRADE,
    Level.HOLD: Reached.HOLD,
    Level.FAULT: Reached.FAULT,
}
_CUT_OFF = {"nack", "hang", "silent"}  # kinds that let no stop through to the motors while they last


class Answer(NamedTuple):
    """Something that the rover said; ``t_s`` on the run's clock, when it was said first."""

    level: Reached
    cause: str
    t_s: float


def judge(scenario: Scenario, run_result: RunResult, well: RunResult) -> Result:
    """Judge a run with its faults, beside one without."""
    begun_s = min((t_s for t_s, _, begins in run_result.monitor.faults if begins), default=None)
    if begun_s is None:
        return _result(scenario, (_of_error(run_result) or "no fault began before the run was over",))
    expect, monitor = scenario.expect, run_result.monitor
    answers = list(_answers(run_result, begun_s))
    wanted = [answer for answer in answers if _counts(answer, expect)]
    worst = max(wanted, key=lambda answer: (answer.level, -answer.t_s), default=Answer(Reached.NONE, "", inf))
    holds_s = min((answer.t_s for answer in wanted if answer.level >= Reached.HOLD), default=None)
    stood_s = None if holds_s is None else _stood_s(monitor, begun_s, holds_s)
    if expect.level is Reached.DEADMAN and (tripped_s := _tripped_s(monitor, begun_s)) is not None:
        worst, stood_s = Answer(Reached.DEADMAN, "the board's deadman", tripped_s), tripped_s - begun_s
    if worst.level is Reached.NONE and expect.answer:
        worst = _of_the_escape_logic(monitor, expect, begun_s) or worst
    detected_s = worst.t_s - begun_s if worst.t_s < inf else None
    changed = first_difference(monitor, well.monitor)
    problems = [
        *(f"broken rule: {rule}" for rule in run_result.broken),
        *_unchanged(changed, begun_s),
        *_missed(expect, worst.level, answers),
        *_late(expect, detected_s, stood_s),
        *_against_the_end(expect, run_result, begun_s),
        *violations(expect, monitor, begun_s),
    ]
    return _result(
        scenario,
        tuple(problems),
        worst.level,
        f"{changed.what} at {changed.t_s - begun_s:+.2f} s" if changed else "nothing",
        detected_s,
        stood_s,
        worst.cause,
    )


def _result(
    scenario: Scenario,
    problems: tuple[str, ...],
    reached: Reached = Reached.NONE,
    changed: str = "nothing",
    detected_s: float | None = None,
    stood_s: float | None = None,
    cause: str = "",
) -> Result:
    expect = scenario.expect
    remarks = [scenario.because, STOOD_ALREADY if stood_s == 0.0 else ""]
    return Result(
        name=scenario.name,
        row=scenario.row,
        about=scenario.about,
        tried=Tried.SIMULATED,
        asked=scenario.asked,
        expected=expect.level,
        reached=reached,
        within_s=None if expect.level is Reached.NONE and not expect.answer else expect.within_s,
        changed=changed,
        detected_s=detected_s,
        stopped_s=stood_s,
        cause=cause,
        problems=problems,
        remark="; ".join(filter(None, remarks)),
    )


def _counts(answer: Answer, expect: Expectation) -> bool:
    """Tell whether an answer is one to the fault: an event, or what a person did, only where the scenario names it."""
    by_itself = answer.level > Reached.NOTE and answer.cause != Condition.OPERATOR_HOLD.value
    return answer.cause in expect.causes or (not expect.causes and by_itself)


def _answers(run_result: RunResult, begun_s: float) -> Iterator[Answer]:
    """Give what the rover said after the fault began: conditions by their level, an error that ended it, events."""
    said = set()
    for moment in run_result.monitor.moments:
        for condition in moment.conditions if moment.t_s >= begun_s else ():
            if condition not in said:
                said.add(condition)
                yield Answer(_LEVELS[LEVELS[condition]], condition.value, moment.t_s)
    if run_result.error is not None and run_result.monitor.ended is not None:
        yield Answer(Reached.FAULT, run_result.monitor.ended, run_result.monitor.ended_s)
    for t_s, name, _ in run_result.monitor.recorded_events:
        if t_s >= begun_s:
            yield Answer(Reached.NOTE, name, t_s)


def _of_the_escape_logic(monitor: RunRecorder, expect: Expectation, begun_s: float) -> Answer | None:
    """Return the first answer to what is no fault of the rover, but the forest's doing."""
    answers = (moment for moment in monitor.moments if moment.t_s >= begun_s and moment.why in expect.answer)
    first = next(answers, None)
    return first and Answer(Reached.NONE, first.why, first.t_s)


def _stood_s(monitor: RunRecorder, begun_s: float, from_s: float) -> float | None:
    """Return the delay from a time to the first stop command; 0 if the wheels were stopped all the time."""
    ticks = [(moment.t_s, moment.commanded == (0.0, 0.0)) for moment in monitor.moments]
    stood = sorted(each for each in (*ticks, *monitor.stood_still_s) if each[0] >= begun_s)
    if all(still for t_s, still in stood if t_s <= from_s):
        return 0.0
    return next((t_s - begun_s for t_s, still in stood if still and t_s >= from_s - ROUNDING_S), None)


def _tripped_s(monitor: RunRecorder, begun_s: float) -> float | None:
    """Return when the wheels stood although no stop could get through to them: then it was the board's own deadman."""
    cuts = [(from_s, from_s + _cuts_for_s(fault)) for from_s, fault, begins in monitor.faults if begins]
    stood_s = (t_s for t_s, still in monitor.stood_still_s if still and t_s >= begun_s)
    return next((t_s for t_s in stood_s if any(from_s < t_s <= to_s for from_s, to_s in cuts)), None)


def _cuts_for_s(fault: Fault) -> float:
    """Return for how long a fault lets no stop through to the wheels."""
    if isinstance(fault.params, LoopStall):
        return fault.params.by_s
    sure = not isinstance(fault.params, Lost) or fault.params == Lost()
    return fault.for_s if fault.target == "motors" and fault.kind in _CUT_OFF and sure else 0.0


def _unchanged(changed: FaultEffect | None, begun_s: float) -> Iterator[str]:
    if changed is None:
        yield "the field code read nothing else than without the fault"
    elif changed.t_s < begun_s - ROUNDING_S:
        yield f"the runs differ before the fault began: {changed.what} at {changed.t_s:.2f} s"


def _missed(expect: Expectation, reached: Reached, answers: list[Answer]) -> Iterator[str]:
    if reached != expect.level:
        others = [f"{each.cause} ({each.level})" for each in answers if each.level > Reached.NOTE]
        heard = f"; the rover said {', '.join(dict.fromkeys(others)) or 'nothing'}"
        yield f"{reached} was reached, {expect.level} is expected{heard}"


def _late(expect: Expectation, detected_s: float | None, stood_s: float | None) -> Iterator[str]:
    if expect.level is Reached.NONE:
        return
    for what, after_s, from_level in (
        ("detected", detected_s, Reached.NOTE),
        ("the wheels stopped", stood_s, Reached.HOLD),
    ):
        if expect.level >= from_level and (after_s is None or after_s > expect.within_s + ROUNDING_S):
            yield f"{what} {_shown(after_s)}, {expect.within_s:g} s are allowed"


def _against_the_end(expect: Expectation, run_result: RunResult, begun_s: float) -> Iterator[str]:
    monitor = run_result.monitor
    if expect.event and not any(t_s >= begun_s and name == expect.event for t_s, name, _ in monitor.recorded_events):
        yield f"no event '{expect.event}' in the log"
    if expect.ends and monitor.ended not in expect.ends:
        yield f"the run ended by '{monitor.ended}', expected is {' or '.join(expect.ends)}"
    if run_result.error is not None and "failed" not in (*expect.causes, *expect.ends):
        yield _of_error(run_result)


def _of_error(run_result: RunResult) -> str:
    return f"the run ended by an error: {run_result.error}" if run_result.error is not None else ""


def _shown(after_s: float | None) -> str:
    return "never" if after_s is None else f"after {after_s:.2f} s"
