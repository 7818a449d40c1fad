"""The data of a run's report: read from its log once, as a stream, despite damage, and prepared for drawing.

Times are seconds since the first record. An unknown number is NaN, which is a gap in a line. Anomalies and events are
layers that can be shown and hidden.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count, pairwise
from math import nan, radians
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.record import Board, Event, Fix, Header, ReckonedPose, Tick, Truth, or_nan
from wayfarer.fieldlog.run_fold import NO_HEADER, AnomalyBegan, Episode, EpisodeBegan, RunFold, RunState, Silence, Told
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.wording import Tone
from wayfarer.logview import palette
from wayfarer.logview.narrator import further, happened
from wayfarer.logview.receiver_fit import MapFix
from wayfarer.logview.summary import RunSummariser, RunSummary
from wayfarer.reports.page.html import PlotLayer
from wayfarer.safety.conditions import Level
from wayfarer.vocabulary import in_words

Floats = NDArray[np.float64]
Columns = Mapping[str, Floats]

PHASES = tuple(phase.value for phase in Phase)
LEVEL_NUMBERS = {level.name.lower(): float(level) for level in Level}
ANOMALY_KINDS = frozenset(anomaly.value for anomaly in Anomaly)
PHASE_INDEX = {phase: float(index) for index, phase in enumerate(PHASES)}
TICK: Mapping[str, Callable[[Tick, RunState], float | None]] = {
    "t_s": lambda tick, _: tick.elapsed_s,
    "phase": lambda tick, _: PHASE_INDEX.get(tick.phase),
    "level": lambda tick, _: LEVEL_NUMBERS.get(tick.level),
    "heading_deg": lambda tick, _: tick.heading_deg,
    "goal_heading_deg": lambda tick, _: tick.goal_heading_deg,
    "counter_deg": lambda tick, _: tick.remembered("counter_deg"),
    "pitch_deg": lambda tick, _: tick.pitch_deg,
    "roll_deg": lambda tick, _: tick.roll_deg,
    "wanted_left": lambda tick, _: tick.wanted_left,
    "wanted_right": lambda tick, _: tick.wanted_right,
    "left": lambda tick, _: tick.applied_left or 0.0,
    "right": lambda tick, _: tick.applied_right or 0.0,
    "measured_m_s": lambda _, state: state.measured_m_s,
    "period_s": lambda _, state: state.period_s,
    "north_m": lambda tick, _: tick.place and tick.north_m,
    "east_m": lambda tick, _: tick.place and tick.east_m,
}
TRUTH = ("t_s", "x_m", "y_m", "phase", "stretch")
FURTHER_MOST = 12  # keys that no view names, each with a panel: a damaged log may have any number of them
BATTERY = ("t_s", "battery_v", "period_s", "stretch")


@dataclass
class RunData:
    """Everything of one run that its report shows.

    ``ticks`` has a column for each name in ``TICK``: ``phase`` counts in ``PHASES``, ``level`` is
    ``conditions.Level``, and ``period_s`` is NaN if records are missing since the tick before. ``further`` has the
    numbers that ticks have under keys that no view names. ``truth`` is where a simulated rover really was, in the
    metres of its forest. ``batteries`` are the voltages and the seconds since the motor board spoke before. These
    tables have a column ``stretch``: the log breaks off between two rows that differ in it.
    """

    header: Header = NO_HEADER
    summary: RunSummary = field(init=False)
    damage: Damage = field(init=False)
    ticks: Columns = field(default_factory=dict)
    further: Columns = field(default_factory=dict)
    truth: Columns = field(default_factory=dict)
    sensors: Mapping[str, SensorStatus] = field(default_factory=dict)
    batteries: Columns = field(default_factory=dict)
    onsets: list[AnomalyBegan] = field(default_factory=list)
    events: list[Event | Silence] = field(default_factory=list)
    fixes: list[MapFix] = field(default_factory=list)
    episodes: list[Episode] = field(default_factory=list)

    @property
    def has_way(self) -> bool:
        """Return whether anybody can say where the rover went."""
        return bool(self.fixes) or not bool(np.isnan(self.ticks["north_m"]).all())

    @property
    def goals(self) -> list[tuple[float, float]]:
        """Return when the rover took each goal, and its heading in degrees.

        Of a log that begins after the first one, it is that of the first tick that has a goal.
        """
        events = [event for event in self.events if isinstance(event, Event) and event.name in {"armed", "goal"}]
        if events:
            taken = ((event.elapsed_s, event.number("goal_heading_deg")) for event in events)
            return [(t_s, goal_deg) for t_s, goal_deg in taken if goal_deg is not None]
        known = ~np.isnan(self.ticks["goal_heading_deg"])
        return list(zip(*(self.ticks[name][known][:1].tolist() for name in ("t_s", "goal_heading_deg")), strict=True))

    def setting(self, section: str, key: str) -> float:
        """Return a number of the rover file, NaN if the header does not have it."""
        value = self.header.setting(section, key)
        return nan if value is None else value


def read_run(run: Path) -> RunData:
    """Read what a report shows of the run in a folder."""
    reader, fold, summariser = RunReader(run), RunFold(), RunSummariser()
    data, ticks, truths, batteries = RunData(), array("d"), array("d"), array("d")
    more: dict[str, array[float]] = {}
    state, board_t_s = fold.state, nan
    for record in reader:
        events = fold.add(record)
        summariser.add(record, state)
        match record:
            case Tick():
                ticks.extend(or_nan(column(record, state)) for column in TICK.values())
                ticks.append(state.stretch)
                _add_further(record, state.ticks, more)
            case Truth():
                phase = or_nan(PHASE_INDEX.get(state.tick.phase))
                truths.extend((record.elapsed_s, record.x_m, record.y_m, phase, state.stretch))
            case Board():
                since_s, board_t_s = record.t_s - board_t_s, record.t_s
                if record.battery_v is not None:
                    batteries.extend((record.elapsed_s, record.battery_v, since_s, state.stretch))
        for event in events:
            _keep(event, state.place, data)
    data.header, data.summary, data.damage = state.header, summariser.summary(state), reader.damage
    data.ticks, data.truth = _columns([*TICK, "stretch"], ticks), _columns(TRUTH, truths)
    data.batteries = _columns(BATTERY, batteries)
    data.further = {key: np.array(column) for key, column in more.items()}
    data.sensors = {name: each for name, each in sorted(state.sensors.items()) if each.readings or each.failures}
    for sensor in data.sensors.values():
        sensor.fell_silent(state.t_s)
    return data


def _add_further(tick: Tick, count: int, more: dict[str, array[float]]) -> None:
    """Add to each column the number that a tick has under its key; one that is new has none in the ticks before."""
    values = {key: value for key in further(tick) if (value := tick.remembered(key)) is not None}
    for key in values:
        if len(more) < FURTHER_MOST:
            more.setdefault(key, array("d", [nan]) * (count - 1))
    for key, column in more.items():
        column.append(values.get(key, nan))


def _keep(event: Told, place: ReckonedPose | None, data: RunData) -> None:
    match event:
        case AnomalyBegan(kind=kind) if kind in ANOMALY_KINDS:
            data.onsets.append(event)
        case Event() | Silence():
            data.events.append(event)
        case Fix():
            data.fixes.append(MapFix.of(event, place))
        case EpisodeBegan():
            data.episodes.append(event.episode)


def _columns(names: Sequence[str], flat: array[float]) -> Columns:
    """Return the columns of rows that stand one after the other."""
    return dict(zip(names, np.array(flat).reshape(-1, len(names)).T, strict=True))


BINS = 3000  # of a line: one for 1.2 s of an hour, and some in each column of pixels of a screen

Line = tuple[Floats, Floats]  # times in seconds, and values


class ValueSpan(NamedTuple):
    """A time in which a value stays the same."""

    start_s: float
    end_s: float
    value: float


def breaks(columns: Columns) -> NDArray[np.bool_]:
    """Return between which rows the log breaks off."""
    between: NDArray[np.bool_] = np.diff(columns["stretch"]) != 0.0
    return between


def at_ticks(ticks: Columns, values: Floats) -> Line:
    """Return the line of a value that each tick has."""
    return broken(ticks["t_s"], values, breaks(ticks))


def around(line: Line, centre_deg: float) -> Line:
    """Return angles as deviations from a centre, -180 to 180 degrees, broken where they go round the back."""
    deviations_deg = (line[1] - centre_deg + 180.0) % 360.0 - 180.0  # as angles.wrap180, of an array
    return broken(line[0], deviations_deg, np.abs(np.diff(deviations_deg)) > 180.0)


def thinned(line: Line, bins: int = BINS) -> Line:
    """Return the smallest and the largest value in each of so many equal times, and every gap."""
    t_s, values = line
    unknown = np.isnan(values)
    again = unknown & np.append(False, unknown[:-1])  # one of several unknown values makes the same gap
    t_s, values, unknown = t_s[~again], values[~again], unknown[~again]
    if t_s.size <= 2 * bins:
        return t_s, values
    part = np.minimum((t_s - t_s[0]) / (t_s[-1] - t_s[0]) * bins, bins - 1).astype(np.intp)
    # A group is what is known within one of the times; sorted by value within it, its first and last are the extremes.
    group = np.cumsum(np.append(0, (np.diff(part) != 0) | (np.diff(unknown) != 0)))
    order = np.lexsort((values, group))
    firsts = np.flatnonzero(np.append(True, np.diff(group[order]) != 0))
    lasts = np.append(firsts[1:] - 1, order.size - 1)
    kept = np.unique(np.concatenate([order[firsts], order[lasts], np.flatnonzero(unknown)]))
    # A value that stays the same needs one point in each of the times.
    stays = np.equal(values[kept][1:-1], values[kept][:-2]) & np.equal(values[kept][1:-1], values[kept][2:])
    kept = kept[~np.pad(stays, 1) | np.isin(kept, order[firsts])]
    return t_s[kept], values[kept]


def spans(ticks: Columns, values: Floats, most: int = BINS) -> list[ValueSpan]:
    """Return the times in which a value of the ticks stays the same, at most ``most``; unknown values have none.

    A value holds until the next tick; the last one, and one before a break, until its own tick.
    """
    t_s = ticks["t_s"]
    if not t_s.size:
        return []
    ends_s = np.append(np.where(breaks(ticks), t_s[:-1], t_s[1:]), t_s[-1])
    all_spans = list(_runs(t_s, ends_s, values))
    if len(all_spans) <= most:
        return all_spans
    grid_s = np.linspace(t_s[0], t_s[-1], most + 1)
    at = np.clip(np.searchsorted(t_s, grid_s[:-1], side="right") - 1, 0, t_s.size - 1)
    return list(_runs(grid_s[:-1], grid_s[1:], values[at]))


def pieces(inside: NDArray[np.bool_], *columns: Floats) -> list[Floats]:
    """Return the parts of a path that begin at points inside, as one line with gaps; each goes on to the next point."""
    changes = np.flatnonzero(np.diff(np.concatenate(([0], inside[:-1], [0]))))
    parts = [slice(first, end + 1) for first, end in changes.reshape(-1, 2)]
    return [np.concatenate([[], *(np.append(column[part], np.nan) for part in parts)]) for column in columns]


def broken(t_s: Floats, values: Floats, between: NDArray[np.bool_]) -> Line:
    """Return a line with a gap between two points where there shall be one."""
    at = np.flatnonzero(between) + 1
    return np.insert(t_s, at, t_s[at]), np.insert(values, at, np.nan)


def _runs(starts_s: Floats, ends_s: Floats, values: Floats) -> Iterator[ValueSpan]:
    """Yield a span for each run of equal values that follow each other without a gap."""
    new = (values[1:] != values[:-1]) | (starts_s[1:] > ends_s[:-1] + 1e-9)
    bounds = np.concatenate(([0], np.flatnonzero(new) + 1, [values.size]))
    for first, end in pairwise(bounds):
        if not np.isnan(values[first]):
            yield ValueSpan(float(starts_s[first]), float(ends_s[end - 1]), float(values[first]))


LAYERS = (
    PlotLayer("anomaly", "anomalies", palette.ANOMALY),
    PlotLayer("mark", "marks", palette.MARK),
    PlotLayer("trouble", "trouble", palette.TROUBLE),
    PlotLayer("person", "operator", palette.PERSON),
    PlotLayer("other", "other", palette.OTHER, shown=False),
)
EDGE: Mapping[str, Any] = {"line_color": palette.EDGE, "line_width": 0.8}
LOOK: Mapping[str, Any] = {"marker": "shape", "angle": "turned", **EDGE}


class EventMark(NamedTuple):
    """Something at a time: its layer, what a pointer shows of it, and the shape and the turn of its mark."""

    t_s: float
    layer: str
    text: str
    shape: str = "diamond"
    turned_deg: float = 0.0


def columns(marks: Sequence[EventMark]) -> dict[str, Any]:
    """Return what marks show, by column of Bokeh's; ``LOOK`` reads them."""
    return {
        "t": [mark.t_s for mark in marks], "what": [mark.text for mark in marks],
        "shape": [mark.shape for mark in marks], "turned": [radians(mark.turned_deg) for mark in marks],
    }  # fmt: skip


def event_marks(data: RunData) -> list[EventMark]:
    """Return all that a run's panels mark, by time."""
    return sorted(_marks(data))


def _marks(data: RunData) -> Iterator[EventMark]:
    for onset in data.onsets:
        shape, turned_deg = palette.ANOMALY_MARKERS[onset.kind]
        yield EventMark(onset.elapsed_s, "anomaly", in_words(onset.kind), shape, turned_deg)
    for event, text in worded_events(data):
        at_s = event.began_s if isinstance(event, Silence) else event.elapsed_s
        if _is_mark(event):
            yield EventMark(at_s, "mark", text, "hex")
        elif is_trouble(event):
            yield EventMark(at_s, "trouble", text)
        else:
            yield EventMark(at_s, "person" if _line(event)[1] is Tone.PERSON else "other", text)


def worded_events(data: RunData) -> Iterator[tuple[Event | Silence, str]]:
    """Give the events of a run, each with the words of a terminal; a person's marks with their numbers."""
    marks = count(1)
    for event in data.events:
        text = _line(event)[0]
        yield event, f"{next(marks)}. {text}" if _is_mark(event) else text


def is_trouble(event: Event | Silence) -> bool:
    """Return whether an event means that something went wrong; a hold that an operator asked for does not."""
    operator_hold = isinstance(event, Event) and event.data.get("cause") == "operator_hold"
    return _line(event)[1] in (Tone.WARNING, Tone.FAULT) and not operator_hold


def _is_mark(event: Event | Silence) -> bool:
    return isinstance(event, Event) and event.name == "mark"


def _line(event: Event | Silence) -> tuple[str, Tone]:
    ((text, tone),) = happened(event)  # of these two kinds always one line
    return text, tone
