"""A run in a few facts and as text, the most important line first; and how much of its log is left."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import hypot, isfinite, isnan
from pathlib import Path
from typing import NamedTuple

from wayfarer.angles import bearing_deg, offset_m
from wayfarer.errors import BadInput
from wayfarer.escape.phases import PhaseEvent
from wayfarer.fieldlog.clock import began_wall_s, duration_text, local_time
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.record import AnyRecord, Event, Fix, Outcome, Tick
from wayfarer.fieldlog.run_fold import LowBattery, RunFold, RunState
from wayfarer.fieldlog.wording import place_text, plural, sentence
from wayfarer.safety.settings import SafetySettings
from wayfarer.vocabulary import in_words, outcome_in_words, whole_deg

NO_OUTCOME = "no outcome: the run was cut off, or is still running"
LATE_S = SafetySettings().tick_late_s  # if a header does not say
# The events that mean that something failed; ``sensor_failed`` is counted by sensor.
FAILURES = {
    "board_silent", "light_failed", "part_failed", "motors_failed", "motors_not_opened", "loop_stalled",
    "stop_not_confirmed", "close_hangs", "control_error", "viewer_failed",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class RangeBearing:
    """Distance and bearing of a place from the start; degrees clockwise from north."""

    distance_m: float
    bearing_deg: float

    def __str__(self) -> str:
        return f"{self.distance_m:.0f} m at bearing {whole_deg(self.bearing_deg)} degrees"


@dataclass(frozen=True, slots=True)
class LastPosition:
    """Where the rover is at the end of its log; None: unknown.

    ``by_reckoning`` is relative to where the rover was first armed if ``from_start``, else to where the log begins. Its
    bearing is from magnetic north; its error grows with the distance and with each missing record. ``by_receiver`` is
    relative to the first fix, with its bearing from true north. ``fix_age_s`` is the time from the last fix to the end.
    """

    by_reckoning: RangeBearing | None = None
    by_receiver: RangeBearing | None = None
    last_fix: Fix | None = None
    fix_age_s: float | None = None
    from_start: bool = True


@dataclass(frozen=True, slots=True)
class Mark:
    """A person's note; ``at_s`` is the time since the beginning."""

    at_s: float
    text: str


@dataclass(frozen=True, slots=True)
class PeriodPercentiles:
    """Median, 99th percentile and longest of the control periods, the time between two ticks; seconds."""

    p50_s: float
    p99_s: float
    max_s: float


@dataclass(frozen=True, slots=True)
class RunSummary:
    """The summary of a run; a value that its log does not have is None (without a header also ``simulated``).

    ``trial`` is the number of a simulated trial, which has virtual time and no ``began_wall_s``. ``lasted_s`` is from
    the first record to the last, ``armed_s`` the part of it while armed, ``held_s`` the part of that with the wheels
    held, by cause, ``limited_s`` that of driving with limits. ``driven_m`` is the true distance of a
    simulated rover, ``commanded_m`` the commanded one and ``reckoned_m`` that of dead reckoning, all three forwards and
    backwards added up.

    ``anomalies`` counts beginnings by kind, ``episodes`` those of all missions, ``recoveries`` how often the rover
    backed off, ``exhausted`` the phases that reached their bound. ``late_ticks`` came more than ``tick_late_s`` of the
    rover file after the tick before. ``sensor_failures`` is by sensor, ``failures`` by name of the event.
    ``dropped`` counts the records that could not be written.
    """

    rover: str | None
    algorithm: str | None
    version: str | None
    seed: int | None
    trial: int | None
    simulated: bool | None
    dry_run: bool | None
    began_wall_s: float | None
    lasted_s: float
    armed_s: float
    held_s: Mapping[str, float]
    limited_s: Mapping[str, float]
    driven_m: float | None
    commanded_m: float | None
    reckoned_m: float
    anomalies: Mapping[str, int]
    episodes: int
    recoveries: int
    exhausted: Mapping[str, int]
    low_battery: LowBattery | None
    ticks: int
    period: PeriodPercentiles | None
    late_ticks: int
    sensor_failures: Mapping[str, int]
    failures: Mapping[str, int]
    marks: tuple[Mark, ...]
    holds: int
    goals: int
    manual: int
    clock_steps_s: tuple[float, ...]
    dropped: int
    reason: str | None
    text: str | None
    where: LastPosition


def summarise(records: Iterable[AnyRecord]) -> RunSummary:
    """Return the summary of a run, as far as its records go."""
    fold, summariser = RunFold(), RunSummariser()
    for record in records:
        fold.add(record)
        summariser.add(record, fold.state)
    return summariser.summary(fold.state)


class RunSummariser:
    """Keeps what a summary needs beyond the fold's state: control periods, marks and clock steps grow with the run."""

    def __init__(self) -> None:
        self._periods_s = array("d")
        self._marks: list[Mark] = []
        self._clock_steps_s: list[float] = []

    def add(self, record: AnyRecord, state: RunState) -> None:
        """Add a record, and the state after it."""
        match record:
            case Tick() if not isnan(state.period_s):
                self._periods_s.append(state.period_s)
            case Event(name="mark"):
                self._marks.append(Mark(record.elapsed_s, record.word("note") or ""))
            case Event(name="clock_step"):
                self._clock_steps_s.append(record.number("by_s") or 0.0)

    def summary(self, state: RunState) -> RunSummary:
        """Return the summary of a run with this state."""
        header, ended, events = state.header, state.ended, state.events
        late_s = header.setting("safety", "tick_late_s") or LATE_S
        ordered, last = sorted(self._periods_s), len(self._periods_s) - 1
        period = PeriodPercentiles(*(ordered[round(part * last)] for part in (0.5, 0.99, 1.0))) if ordered else None
        return RunSummary(
            rover=header.rover,
            algorithm=header.algorithm,
            version=header.version,
            seed=header.seed,
            trial=header.trial,
            simulated=header.simulated,
            dry_run=header.dry_run,
            began_wall_s=None if header.trial is not None else began_wall_s(state.last),
            lasted_s=state.lasted_s,
            armed_s=state.armed_s,
            held_s=dict(state.held_s),
            limited_s=dict(state.limited_s),
            driven_m=state.driven_m,
            commanded_m=state.tick.travelled_m,
            reckoned_m=state.tick.path_m,
            anomalies=dict(state.anomalies),
            episodes=state.episodes,
            recoveries=state.recoveries,
            exhausted=dict(state.exhausted),
            low_battery=state.low_battery,
            ticks=state.ticks,
            period=period,
            late_ticks=sum(period_s > late_s for period_s in self._periods_s),
            sensor_failures={name: sensor.failures for name, sensor in state.sensors.items() if sensor.failures},
            failures={name: count for name, count in events.items() if name in FAILURES},
            marks=tuple(self._marks),
            holds=events["hold"],
            goals=events["goal"],
            manual=events["manual"],
            clock_steps_s=tuple(self._clock_steps_s),
            dropped=state.dropped,
            reason=ended.reason if ended else None,
            text=ended.text if ended else None,
            where=_last_position(state),
        )


def _last_position(state: RunState) -> LastPosition:
    """Return where the rover is now."""
    place, first, fix = state.place, state.first_fix, state.fix
    start_m = (state.start.north_m, state.start.east_m) if state.start else (0.0, 0.0)
    reckoned = None if place is None else _offset(place.north_m - start_m[0], place.east_m - start_m[1])
    drove = reckoned is not None and reckoned.distance_m > 0.0
    return LastPosition(
        by_reckoning=reckoned,
        by_receiver=None if first is None or fix is None else _offset(*offset_m(first, fix)),
        last_fix=fix,
        fix_age_s=None if fix is None else max(0.0, state.t_s - fix.t_s),
        from_start=not drove if state.from_start is None else state.from_start,
    )


def _offset(north_m: float, east_m: float) -> RangeBearing | None:
    distance_m = hypot(north_m, east_m)
    return RangeBearing(distance_m, bearing_deg(north_m, east_m)) if isfinite(distance_m) else None


def result_sentences(summary: RunSummary, damage: Damage) -> Iterator[str]:
    """Yield how a run ended, after what time and distance, with how many anomalies; then what its log has lost."""
    count, after = sum(summary.anomalies.values()), [duration_text(summary.lasted_s)]
    if summary.driven_m is not None:
        after.append(f"{summary.driven_m:.1f} m")
    elif summary.commanded_m is not None:
        after.append(f"{summary.reckoned_m:.1f} m by dead reckoning")
    what = f"after {' and '.join(filter(None, after))}, with {count or 'no'} {'anomalies' if count > 1 else 'anomaly'}"
    cut_off = f"The log ends {what}; {NO_OUTCOME}."
    yield cut_off if summary.reason is None else f"{sentence(_outcome(summary))}, {what}."
    if damage:
        yield f"Of its log, {damage}."


def summary_text(run: str, summary: RunSummary, damage: Damage) -> str:
    """Return the summary of a run as lines, without empty parts."""
    return "\n".join(
        f"{title if first else '':<11}{text}"
        for title, texts in summary_facts(run, summary, damage)
        for first, text in zip([True, *[False] * len(texts)], texts, strict=False)
    )


def summary_facts(run: str, summary: RunSummary, damage: Damage, *, utc: bool = False) -> list[tuple[str, list[str]]]:
    """Return the parts of a summary, each title with its lines; ``utc``: not in the local time."""
    silent = {f"{sensor} did not answer": count for sensor, count in summary.sensor_failures.items()}
    facts: list[tuple[str, Iterable[str]]] = [
        ("run", [run, _about(summary)]),
        ("outcome", [_outcome(summary)]),
        ("where", where_lines(summary.where, damage.missing)),
        ("time", _time(summary, utc=utc)),
        ("distance", [distance_line(summary)]),
        ("anomalies", [counted({in_words(kind): count for kind, count in summary.anomalies.items()})]),
        ("escapes", [_escapes(summary)]),
        ("battery", [_battery(summary)]),
        ("failures", [counted({**silent, **summary.failures})]),
        ("operator", _operator(summary)),
        ("clock", [", ".join(f"set by {step_s:+.0f} s" for step_s in summary.clock_steps_s)]),
        ("ticks", [_ticks(summary)]),
        ("log", [_log(summary, damage)]),
    ]
    filled = ((title, list(filter(None, lines))) for title, lines in facts)
    return [(title, lines) for title, lines in filled if lines]


def _about(summary: RunSummary) -> str:
    if summary.version is None and summary.simulated is None:
        return "unknown rover: the log has no header"
    about = [summary.rover or "unknown rover", summary.algorithm, "simulated" if summary.simulated else None]
    about += [None if summary.trial is None else f"trial {summary.trial}"]
    about += ["dry run" if summary.dry_run else None, f"wayfarer {summary.version}" if summary.version else None]
    return ", ".join(text for text in about if text)


def _outcome(summary: RunSummary) -> str:
    if summary.reason is None:
        return NO_OUTCOME
    word, text = outcome_in_words(summary.reason), summary.text or ""
    return text if text.startswith(word) else ": ".join(filter(None, [word, text]))


def where_lines(where: LastPosition, missing: int) -> Iterator[str]:
    """Say where to search for the rover; the receiver first, if there is one."""
    fix = where.last_fix
    if fix is not None:
        yield f"{place_text(fix)}, {where.fix_age_s:.0f} s before the end"
    if where.by_receiver is not None:
        yield f"{where.by_receiver} true from the first position"
    if where.by_reckoning is not None:
        origin = "the start" if where.from_start else "where the log begins"
        yield f"{where.by_reckoning} magnetic from {origin} (dead reckoning)"
        if missing:
            yield f"{Damage(missing=missing)}, so the path is only partly known"


def _time(summary: RunSummary, *, utc: bool) -> Iterator[str]:
    lasted, armed = duration_text(summary.lasted_s), duration_text(summary.armed_s)
    if summary.began_wall_s is not None:
        began = f" from {local_time(summary.began_wall_s, '%Y-%m-%d %H:%M:%S', utc=utc)}{' UTC' if utc else ''}"
    else:
        began = "" if summary.trial is not None else " (start time unknown: the clock was not set)"
    yield f"{lasted} in total{began}; armed for {armed}"
    for how, times_s in (("held", summary.held_s), ("drove with limits", summary.limited_s)):
        yield from (f"{how} for {duration_text(for_s, 1)}: {in_words(cause)}" for cause, for_s in times_s.items())


def distance_line(summary: RunSummary) -> str:
    """Say how far the rover went."""
    if summary.commanded_m is None:
        return ""
    driven = "" if summary.driven_m is None else f"{summary.driven_m:.1f} m driven, "
    return f"{driven}{summary.commanded_m:.1f} m commanded, {summary.reckoned_m:.1f} m by dead reckoning"


def counted(counts: Mapping[str, int]) -> str:
    """Return names with how often each was counted, the most frequent first."""
    return ", ".join(f"{what} {count}" for what, count in sorted(counts.items(), key=lambda item: -item[1]) if count)


def _escapes(summary: RunSummary) -> str:
    if not summary.ticks:
        return ""
    ended = {in_words(f"{phase}.{PhaseEvent.EXHAUSTED.value}"): count for phase, count in summary.exhausted.items()}
    return "; ".join(filter(None, [f"episodes {summary.episodes}, backed off {summary.recoveries}", counted(ended)]))


def _battery(summary: RunSummary) -> str:
    if (low := summary.low_battery) is None:
        return ""
    return f"lowest {low.battery_v:.1f} V, at {duration_text(low.at_s)}, with the wheels at {low.duty:.0%}"


def _operator(summary: RunSummary) -> Iterator[str]:
    marks, drives = len(summary.marks), summary.manual
    yield counted({"marks": marks, "holds": summary.holds, "new goals": summary.goals, "drives by hand": drives})
    yield from (f"{duration_text(mark.at_s)} {mark.text}" for mark in summary.marks)


def _ticks(summary: RunSummary) -> str:
    period = summary.period
    if period is None:
        return ""
    p50_ms, p99_ms, max_ms = (1e3 * period_s for period_s in (period.p50_s, period.p99_s, period.max_s))
    return f"{summary.ticks}, every {p50_ms:.1f} ms (p99 {p99_ms:.1f}, longest {max_ms:.1f}); {summary.late_ticks} late"


def _log(summary: RunSummary, damage: Damage) -> str:
    lost = [str(damage)] if damage else []
    if summary.dropped and damage.missing:
        lost = [f"{damage}, {min(summary.dropped, damage.missing)} of them could not be written"]
    elif summary.dropped:
        lost.append(f"{plural(summary.dropped, 'record')} could not be written")
    if summary.reason is None:
        lost.append(NO_OUTCOME)
    return "; ".join(lost) or "complete"


class LogIntegrity(IntEnum):
    """How much of a log is left; the later, the worse."""

    COMPLETE = 0
    PARTIAL = 1
    UNREADABLE = 2

    @property
    def exit_code(self) -> int:
        """0 for complete, 3 for partial, 1 for unreadable: as ``mcap recover`` has it."""
        return (0, 3, 1)[self]


class LogVerdict(NamedTuple):
    """What was found in one log; ``wrong`` says what is not as it should be."""

    integrity: LogIntegrity
    records: int
    wrong: tuple[str, ...]

    def __str__(self) -> str:
        readable = "" if self.integrity is LogIntegrity.COMPLETE else "readable "
        records = plural(self.records, f"{readable}record")
        return "; ".join([f"{self.integrity.name.lower()}: {records}", *self.wrong])


def check_log(run: Path) -> LogVerdict:
    """Read a whole run and return its integrity; an unfinished run has no outcome, and is at best partial."""
    records, ended = 0, False
    try:
        reader = RunReader(run)
        for record in reader:
            ended = ended or isinstance(record, Outcome)
            records += 1
    except BadInput as error:
        return LogVerdict(LogIntegrity.UNREADABLE, records, (str(error),))
    wrong = tuple(filter(None, (str(reader.damage) if reader.damage else "", "" if ended else NO_OUTCOME)))
    return LogVerdict(LogIntegrity.PARTIAL if wrong else LogIntegrity.COMPLETE, records, wrong)
