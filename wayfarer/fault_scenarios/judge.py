"""Judges a scenario: did the fault take effect, how severe was the response, and how long did it take."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import inf

from wayfarer.fault_scenarios.answers import ROUNDING_S, Answer, answers, counts, escape_answer, stood_s, tripped_s
from wayfarer.fault_scenarios.first_difference import FaultEffect, first_difference
from wayfarer.fault_scenarios.recorder import RunRecorder
from wayfarer.fault_scenarios.result import Result, not_run
from wayfarer.fault_scenarios.runner import RunResult
from wayfarer.fault_scenarios.scenario import Expectation, Reached, Scenario

STOOD_ALREADY = "the wheels were stopped already"


def judge(scenario: Scenario, run_result: RunResult, well: RunResult) -> Result:
    """Judge a run with its faults, beside one without."""
    expect, monitor = scenario.expect, run_result.monitor
    result = not_run(scenario)._replace(
        within_s=None if expect.level is Reached.NONE and not expect.answer else expect.within_s,
        changed="nothing",
        remark=scenario.because,
    )
    begun_s = min((t_s for t_s, _, begins in monitor.faults if begins), default=None)
    if begun_s is None:
        return result._replace(problems=(_error(run_result) or "no fault began before the run was over",))
    said = list(answers(monitor, begun_s))
    worst, stopped_s = _response(monitor, expect, begun_s, [answer for answer in said if counts(answer, expect)])
    detected_s = worst.t_s - begun_s if worst.t_s < inf else None
    changed = first_difference(monitor, well.monitor)
    problems = (
        *(f"broken rule: {rule}" for rule in run_result.broken),
        *_unchanged(changed, begun_s),
        *_missed(expect, worst.level, said),
        *_late(expect, detected_s, stopped_s),
        *_wrong_end(expect, run_result, begun_s),
        *_unanswered(expect, monitor, begun_s),
        *_unwanted(expect, monitor, begun_s),
        *_gaps(expect, monitor),
        *_still_turning(expect, monitor, begun_s),
    )
    return result._replace(
        reached=worst.level,
        changed=f"{changed.what} at {changed.t_s - begun_s:+.2f} s" if changed else "nothing",
        detected_s=detected_s,
        stopped_s=stopped_s,
        cause=worst.cause,
        problems=problems,
        remark="; ".join(filter(None, (scenario.because, STOOD_ALREADY if stopped_s == 0.0 else ""))),
    )


def _response(
    monitor: RunRecorder, expect: Expectation, begun_s: float, wanted: list[Answer]
) -> tuple[Answer, float | None]:
    """Return the severest of the answers that count, and after how long the wheels were stopped."""
    worst = max(wanted, key=lambda answer: (answer.level, -answer.t_s), default=Answer(Reached.NONE, "", inf))
    holds_s = min((answer.t_s for answer in wanted if answer.level >= Reached.HOLD), default=None)
    if expect.level is Reached.DEADMAN and (at_s := tripped_s(monitor, begun_s)) is not None:
        return Answer(Reached.DEADMAN, "the board's deadman", at_s), at_s - begun_s
    if worst.level is Reached.NONE and (tick := escape_answer(monitor, expect, begun_s)):
        worst = Answer(Reached.NONE, tick.why, tick.t_s)  # to what is no fault of the rover
    return worst, None if holds_s is None else stood_s(monitor, begun_s, holds_s)


def _unchanged(changed: FaultEffect | None, begun_s: float) -> Iterator[str]:
    if changed is None:
        yield "the field code read nothing else than without the fault"
    elif changed.t_s < begun_s - ROUNDING_S:
        yield f"the runs differ before the fault began: {changed.what} at {changed.t_s:.2f} s"


def _missed(expect: Expectation, reached: Reached, said: list[Answer]) -> Iterator[str]:
    if reached != expect.level:
        others = [f"{each.cause} ({each.level})" for each in said if each.level > Reached.NOTE]
        heard = f"; the rover said {', '.join(dict.fromkeys(others)) or 'nothing'}"
        yield f"{reached} was reached, {expect.level} is expected{heard}"


def _late(expect: Expectation, detected_s: float | None, stopped_s: float | None) -> Iterator[str]:
    if expect.level is not Reached.NONE:
        yield from _later("detected", detected_s, expect.within_s)
    if expect.level >= Reached.HOLD:
        yield from _later("the wheels stopped", stopped_s, expect.within_s)


def _later(what: str, after_s: float | None, within_s: float) -> Iterator[str]:
    if after_s is None or after_s > within_s + ROUNDING_S:
        yield f"{what} {'never' if after_s is None else f'after {after_s:.2f} s'}, {within_s:g} s are allowed"


def _wrong_end(expect: Expectation, run_result: RunResult, begun_s: float) -> Iterator[str]:
    monitor = run_result.monitor
    if expect.event and not any(t_s >= begun_s and name == expect.event for t_s, name, _ in monitor.recorded_events):
        yield f"no event '{expect.event}' in the log"
    if expect.ends and monitor.ended not in expect.ends:
        yield f"the run ended by '{monitor.ended}', expected is {' or '.join(expect.ends)}"
    if run_result.error is not None and "failed" not in (*expect.causes, *expect.ends):
        yield _error(run_result)


def _error(run_result: RunResult) -> str:
    return f"the run ended by an error: {run_result.error}" if run_result.error is not None else ""


def _unanswered(expect: Expectation, monitor: RunRecorder, begun_s: float) -> Iterator[str]:
    tick = escape_answer(monitor, expect, begun_s)
    if tick is not None:
        yield from _later(tick.why, tick.t_s - begun_s, expect.within_s)
    elif expect.answer:
        yield f"the escape logic never answered by {' or '.join(expect.answer)}"


def _unwanted(expect: Expectation, monitor: RunRecorder, begun_s: float) -> Iterator[str]:
    came = {event.name for event in monitor.recorded_events if event.t_s >= begun_s}
    for moment in monitor.moments:
        if moment.t_s >= begun_s:
            came |= {moment.why, *(condition.value for condition in moment.conditions)}
    yield from (f"there was '{name}', which must not come" for name in expect.never if name in came)


def _gaps(expect: Expectation, monitor: RunRecorder) -> Iterator[str]:
    most_s = expect.ticks_within_s
    gap_s = max((now.t_s - last.t_s for last, now in pairwise(monitor.moments)), default=0.0)
    if most_s is not None and gap_s > most_s + ROUNDING_S:
        yield f"{gap_s:.2f} s between two ticks, {most_s:g} s are allowed"


def _still_turning(expect: Expectation, monitor: RunRecorder, begun_s: float) -> Iterator[str]:
    if expect.stands_within_s is not None:
        still_s = min((t_s for t_s, still in monitor.stood_still_s if still and t_s >= begun_s), default=inf)
        yield from _later("the wheels stopped", still_s - begun_s, expect.stands_within_s)
