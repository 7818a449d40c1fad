"""Faults on purpose: what a rover does when a part fails, for tests of rover files, drivers and algorithms.

::

    def test_a_silent_compass_stops_the_wheels():
        fault = Fault(at_s=15.0, for_s=5.0, target="compass", kind="silent")
        expect = Expectation(ResponseLevel.HOLD, within_s=1.0, causes=("compass_stale",))
        result = run_fault_scenario(Scenario(name="silent", rover="./mine.toml", faults=(fault,), expect=expect))
        assert result.passed, result.problems

``read_scenarios`` reads scenarios from a file. A scenario is run with its faults and without: a fault takes effect
where the field code reads something that it would not have read without it. In each run the five safety rules are
monitored from outside (``safety_rules.py``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, zip_longest
from math import inf
from pathlib import Path
from typing import NamedTuple, TypeVar

from wayfarer.hal import Snapshot
from wayfarer.safety.conditions import LEVELS, Condition
from wayfarer.simhal.faults.bus import Nack
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.process import LoopStall
from wayfarer.testing.scenario import RESPONSE_LEVELS, Command, Expectation, ResponseLevel, Scenario, read_scenarios
from wayfarer.testing.scenario_run import RunRecorder, RunResult, run_scenario, run_without_faults

__all__ = [
    "Command",
    "Expectation",
    "Fault",
    "ResponseLevel",
    "Result",
    "Scenario",
    "read_scenarios",
    "run_fault_scenario",
]

T = TypeVar("T")
_Pair = tuple[float, T | None, T | None]

ROUNDING_S = 1e-6

_CUT_OFF = {"nack", "hang", "silent"}  # kinds that let no stop through to the motors while they last


class Result(NamedTuple):
    """How a scenario's faults were met.

    ``reached`` is the severest level of what counts as an answer, and ``cause`` what reported it. ``detected_s`` and
    ``stopped_s`` are seconds from the beginning of the first fault to that answer and to the first stop command, 0 if
    the wheels were stopped already; None if there is none. ``changed`` says what the field code read, or received,
    that it would not have without the faults. ``problems`` is empty if all was as expected.
    """

    reached: ResponseLevel = ResponseLevel.NONE
    cause: str = ""
    detected_s: float | None = None
    stopped_s: float | None = None
    changed: str = "nothing"
    problems: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all was as expected."""
        return not self.problems


def run_fault_scenario(scenario: Scenario, log_dir: Path | None = None) -> Result:
    """Run a scenario on the simulated rover, with its faults and without them, and judge the difference.

    With ``log_dir`` the full field log of the run with the faults is written there.

    Raises:
        BadInput: a fault cannot happen to the rover, or the log cannot be written.
    """
    return judge(scenario, run_scenario(scenario, log_dir), run_without_faults(scenario))


def judge(scenario: Scenario, run_result: RunResult, well: RunResult) -> Result:
    """Judge a run with its faults, beside one without."""
    begun_s = min((t_s for t_s, _, begins in run_result.recorder.faults if begins), default=None)
    if begun_s is None:
        return Result(problems=(_error(run_result) or "no fault began before the run was over",))
    response = _Response(scenario.expect, run_result, begun_s)
    changed = first_difference(run_result.recorder, well.recorder)
    return Result(
        response.worst.level,
        response.worst.cause,
        response.detected_s,
        response.stopped_s,
        f"{changed.what} at {changed.t_s - begun_s:+.2f} s" if changed else "nothing",
        (
            *(f"broken rule: {rule}" for rule in run_result.broken),
            *_unchanged(changed, begun_s),
            *response.problems(),
        ),
    )


class Answer(NamedTuple):
    """Something that the rover said; ``t_s`` on the run's clock, when it was said first."""

    level: ResponseLevel
    cause: str
    t_s: float


class _Response:
    """What the rover said and did from the beginning of the fault on, compared with what is expected of it."""

    def __init__(self, expect: Expectation, run_result: RunResult, begun_s: float) -> None:
        self._expect, self._run_result, self._begun_s = expect, run_result, begun_s
        self._recorder = recorder = run_result.recorder
        self._ticks = [tick for tick in recorder.ticks if tick.t_s >= begun_s]
        self._events = [event for event in recorder.events if event.t_s >= begun_s]
        self._stood = [(t_s, still) for t_s, still in recorder.stood_still_s if t_s >= begun_s]
        self._said = list(self._answers())
        self._escape = next((tick for tick in self._ticks if tick.why in expect.answer), None)
        wanted = [answer for answer in self._said if self._counts(answer)]
        self.worst, self.stopped_s = self._worst(wanted), self._stopped_s(wanted)
        if expect.level is ResponseLevel.DEADMAN and (tripped_s := self._tripped_s()) is not None:
            self.worst = Answer(ResponseLevel.DEADMAN, "the board's deadman", tripped_s)
            self.stopped_s = tripped_s - begun_s
        self.detected_s = self.worst.t_s - begun_s if self.worst.t_s < inf else None

    def problems(self) -> Iterator[str]:
        """Give what is not as expected."""
        expect = self._expect
        yield from self._missed()
        if expect.level is not ResponseLevel.NONE:
            yield from _later("detected", self.detected_s, expect.within_s)
        if expect.level >= ResponseLevel.HOLD:
            yield from _later("the wheels stopped", self.stopped_s, expect.within_s)
        yield from self._wrong_end()
        yield from self._unanswered()
        yield from self._unwanted()
        yield from self._gaps()
        if expect.stands_within_s is not None:
            still_s = min((t_s for t_s, still in self._stood if still), default=inf)
            yield from _later("the wheels stopped", still_s - self._begun_s, expect.stands_within_s)

    def _answers(self) -> Iterator[Answer]:
        """Give what the rover said: conditions by their level, an error that ended it, events."""
        said = set()
        for tick in self._ticks:
            for condition in tick.conditions:
                if condition not in said:
                    said.add(condition)
                    yield Answer(RESPONSE_LEVELS[LEVELS[condition]], condition.value, tick.t_s)
        if self._recorder.ended == "failed":
            yield Answer(ResponseLevel.FAULT, self._recorder.ended, self._recorder.ended_s)
        for t_s, name, _ in self._events:
            yield Answer(ResponseLevel.NOTE, name, t_s)

    def _counts(self, answer: Answer) -> bool:
        """Return whether an answer is one to the fault: an event, or what a person did, only if it is expected."""
        by_itself = answer.level > ResponseLevel.NOTE and answer.cause != Condition.OPERATOR_HOLD.value
        return answer.cause in self._expect.causes or (not self._expect.causes and by_itself)

    def _worst(self, wanted: list[Answer]) -> Answer:
        """Return the severest of the answers that count, the first of several."""
        worst = max(wanted, key=lambda answer: (answer.level, -answer.t_s), default=Answer(ResponseLevel.NONE, "", inf))
        if (
            worst.level is ResponseLevel.NONE and self._escape is not None
        ):  # an answer to what is not a fault of the rover
            return Answer(ResponseLevel.NONE, self._escape.why, self._escape.t_s)
        return worst

    def _stopped_s(self, wanted: list[Answer]) -> float | None:
        """Return the delay to the first stop command from a hold on; 0 if the wheels were always stopped."""
        holds_s = min((answer.t_s for answer in wanted if answer.level >= ResponseLevel.HOLD), default=None)
        if holds_s is None:
            return None
        ticks = [(tick.t_s, tick.commanded == (0.0, 0.0)) for tick in self._ticks]
        stood = sorted((*ticks, *self._stood))
        if all(still for t_s, still in stood if t_s <= holds_s):
            return 0.0
        return next((t_s - self._begun_s for t_s, still in stood if still and t_s >= holds_s - ROUNDING_S), None)

    def _tripped_s(self) -> float | None:
        """Return when the wheels were stopped although no stop could reach them: the board's own deadman did it."""
        cuts = [(from_s, from_s + _cuts_for_s(fault)) for from_s, fault, begins in self._recorder.faults if begins]
        times_s = (t_s for t_s, still in self._stood if still)
        return next((t_s for t_s in times_s if any(from_s < t_s <= to_s for from_s, to_s in cuts)), None)

    def _missed(self) -> Iterator[str]:
        if self.worst.level != self._expect.level:
            others = [f"{each.cause} ({each.level})" for each in self._said if each.level > ResponseLevel.NOTE]
            heard = f"; the rover said {', '.join(dict.fromkeys(others)) or 'nothing'}"
            yield f"{self.worst.level} was reached, {self._expect.level} is expected{heard}"

    def _wrong_end(self) -> Iterator[str]:
        expect, ended = self._expect, self._recorder.ended
        if expect.event and not any(event.name == expect.event for event in self._events):
            yield f"no event '{expect.event}' in the log"
        if expect.ends and ended not in expect.ends:
            yield f"the run ended by '{ended}', expected is {' or '.join(expect.ends)}"
        if self._run_result.error is not None and "failed" not in (*expect.causes, *expect.ends):
            yield _error(self._run_result)

    def _unanswered(self) -> Iterator[str]:
        if self._escape is not None:
            yield from _later(self._escape.why, self._escape.t_s - self._begun_s, self._expect.within_s)
        elif self._expect.answer:
            yield f"the escape logic never responded with {' or '.join(self._expect.answer)}"

    def _unwanted(self) -> Iterator[str]:
        came = {answer.cause for answer in self._said} | {tick.why for tick in self._ticks}
        yield from (f"there was '{name}', which must not occur" for name in self._expect.never if name in came)

    def _gaps(self) -> Iterator[str]:
        most_s = self._expect.ticks_within_s
        gap_s = max((now.t_s - last.t_s for last, now in pairwise(self._recorder.ticks)), default=0.0)
        if most_s is not None and gap_s > most_s + ROUNDING_S:
            yield f"{gap_s:.2f} s between two ticks, {most_s:g} s are allowed"


def _unchanged(changed: FaultEffect | None, begun_s: float) -> Iterator[str]:
    if changed is None:
        yield "the fault changed nothing that the field code read"
    elif changed.t_s < begun_s - ROUNDING_S:
        yield f"the runs differ before the fault began: {changed.what} at {changed.t_s:.2f} s"


def _later(what: str, after_s: float | None, within_s: float) -> Iterator[str]:
    if after_s is None or after_s > within_s + ROUNDING_S:
        yield f"{what} {'never' if after_s is None else f'after {after_s:.2f} s'}, {within_s:g} s are allowed"


def _error(run_result: RunResult) -> str:
    return f"the run ended by an error: {run_result.error}" if run_result.error is not None else ""


def _cuts_for_s(fault: Fault) -> float:
    """Return for how long a fault lets no stop through to the wheels."""
    if isinstance(fault.params, LoopStall):
        return fault.params.by_s
    sure = not isinstance(fault.params, Nack) or fault.params == Nack()
    return fault.for_s if fault.target == "motors" and fault.kind in _CUT_OFF and sure else 0.0


class FaultEffect(NamedTuple):
    """What is different, and when, in seconds on the runs' clock."""

    t_s: float
    what: str


def first_difference(recorder: RunRecorder, well: RunRecorder) -> FaultEffect | None:
    """Return the first difference between a run with a fault and the same run without, None if there is none."""
    return min(_differences(recorder, well), key=lambda difference: difference.t_s, default=None)


def _differences(recorder: RunRecorder, well: RunRecorder) -> Iterator[FaultEffect]:
    """Return the first difference of each kind, those that say most first."""
    ticks = [(tick.t_s, tick.snapshot) for tick in recorder.ticks]
    well_ticks = [(tick.t_s, tick.snapshot) for tick in well.ticks]
    for t_s, now, then in _first(ticks, well_ticks, recorder.ended_s):
        yield FaultEffect(t_s, _of_snapshots(now, then))
    for t_s, _, _ in _first(recorder.boards, well.boards, recorder.ended_s):
        yield FaultEffect(t_s, "answer of the motor board")
    fixes, well_fixes = ([(fix.t_s, fix) for fix in each.fixes if fix is not None] for each in (recorder, well))
    for t_s, _, _ in _first(fixes, well_fixes, recorder.ended_s):
        yield FaultEffect(t_s, "position")
    events, well_events = ([(each.t_s, each) for each in log.events] for log in (recorder, well))
    for t_s, event, well_event in _first(events, well_events, recorder.ended_s):
        if there := event or well_event:
            yield FaultEffect(t_s, f"{'' if event else 'no '}event {there.name}")


def _first(run: Sequence[tuple[float, T]], well: Sequence[tuple[float, T]], ended_s: float) -> Iterator[_Pair[T]]:
    """Give the first items of two runs that are not the same, with the time; None if one run has no more."""
    for item, well_item in zip_longest(run, well):
        if item is None:
            yield min(well_item[0], ended_s), None, well_item[1]
        elif well_item is None or item[1] != well_item[1]:
            yield item[0], item[1], well_item and well_item[1]
        else:
            continue
        return


def _of_snapshots(now: Snapshot | None, then: Snapshot | None) -> str:
    if now is None or then is None:
        return "no further control tick" if now is None else "a further control tick"
    for part in ("compass", "motion", "contact", "wheels"):
        read, well = getattr(now, part), getattr(then, part)
        if read == well:
            continue
        if read is None or well is None:
            return f"{part}: {'no' if read is None else 'a'} reading"
        # A reading's time is the last to name: an older reading is another one in all its numbers.
        names = [name for name in (*read.__match_args__[1:], "t_s") if getattr(read, name) != getattr(well, name)]
        late = read.t_s < well.t_s
        return f"{part}: an older reading" if late else f"{part}.{names[0]}"
    return "time of the control tick"
