"""The summary of a run: distance, duration, anomalies, and where the rover is likely to be. Pure."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import hypot, isfinite, isnan

from wayfarer.angles import bearing_deg, offset_m
from wayfarer.fieldlog.clock import began_wall_s
from wayfarer.fieldlog.record import AnyRecord, Event, Fix, Tick
from wayfarer.fieldlog.run_fold import LowBattery, RunFold, RunState
from wayfarer.safety.settings import SafetySettings

LATE_S = SafetySettings().tick_late_s  # if a header does not tell
# The events that tell of something that failed; ``sensor_failed`` is counted by sensor.
FAILURES = {
    "board_silent", "light_failed", "part_failed", "motors_failed", "motors_not_opened", "loop_stalled",
    "stop_not_confirmed", "close_hangs", "control_error", "viewer_failed",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class RangeBearing:
    """Distance and bearing of a place from the start; degrees clockwise from north."""

    distance_m: float
    bearing_deg: float


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
        fold.take(record)
        summariser.take(record, fold.state)
    return summariser.summary(fold.state)


class RunSummariser:
    """Keeps what a summary needs beyond the fold's state: control periods, marks and clock steps grow with the run."""

    def __init__(self) -> None:
        self._periods_s = array("d")
        self._marks: list[Mark] = []
        self._clock_steps_s: list[float] = []

    def take(self, record: AnyRecord, state: RunState) -> None:
        """Take a record, and the state after it."""
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
            period=self._spread(),
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

    def _spread(self) -> PeriodPercentiles | None:
        """Return how the control periods spread; None if there is none."""
        ordered, last = sorted(self._periods_s), len(self._periods_s) - 1
        return PeriodPercentiles(*(ordered[round(part * last)] for part in (0.5, 0.99, 1.0))) if ordered else None


def _last_position(state: RunState) -> LastPosition:
    """Return where the rover is now."""
    reckoned, fix = _by_reckoning(state), state.fix
    drove = reckoned is not None and reckoned.distance_m > 0.0
    return LastPosition(
        by_reckoning=reckoned,
        by_receiver=_by_receiver(state),
        last_fix=fix,
        fix_age_s=None if fix is None else max(0.0, state.t_s - fix.t_s),
        from_start=not drove if state.from_start is None else state.from_start,
    )


def _by_reckoning(state: RunState) -> RangeBearing | None:
    place, start = state.place, state.start
    if place is None:
        return None
    start_north_m, start_east_m = (start.north_m, start.east_m) if start else (0.0, 0.0)
    return _offset(place.north_m - start_north_m, place.east_m - start_east_m)


def _by_receiver(state: RunState) -> RangeBearing | None:
    first, last = state.first_fix, state.fix
    return None if first is None or last is None else _offset(*offset_m(first, last))


def _offset(north_m: float, east_m: float) -> RangeBearing | None:
    distance_m = hypot(north_m, east_m)
    return RangeBearing(distance_m, bearing_deg(north_m, east_m)) if isfinite(distance_m) else None
