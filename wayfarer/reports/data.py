"""The data of a run's report, read from its log once, as a stream, and despite damage.

Times are seconds since the first record. An unknown number is NaN, which is a gap in a line.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import nan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.record import Board, Event, Fix, Header, ReckonedPose, Tick, Truth, or_nan
from wayfarer.fieldlog.run_fold import (
    NO_HEADER,
    AnomalyBegan,
    Episode,
    EpisodeBegan,
    RunFold,
    RunState,
    Silence,
    Told,
)
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.logview.receiver_fit import MapFix
from wayfarer.logview.run_narrator import further
from wayfarer.logview.summary import RunSummariser, RunSummary
from wayfarer.safety.conditions import Level

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
            told = ((event.elapsed_s, event.number("goal_heading_deg")) for event in events)
            return [(t_s, goal_deg) for t_s, goal_deg in told if goal_deg is not None]
        known = ~np.isnan(self.ticks["goal_heading_deg"])
        return list(zip(*(self.ticks[name][known][:1].tolist() for name in ("t_s", "goal_heading_deg")), strict=True))

    def setting(self, section: str, key: str) -> float:
        """Return a number of the rover file, NaN if the header does not have it."""
        value = self.header.setting(section, key)
        return nan if value is None else value


def read_run(run: Path) -> RunData:
    """Read what a report shows of the run in a folder.

    Raises:
        BadInput: there is no log in it, or nothing of it can be read.
    """
    reader, fold, summariser = RunReader(run), RunFold(), RunSummariser()
    data, ticks, truths, batteries = RunData(), array("d"), array("d"), array("d")
    more: dict[str, array[float]] = {}
    state, board_t_s = fold.state, nan
    for record in reader:
        told = fold.take(record)
        summariser.take(record, state)
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
        for each in told:
            _keep(each, state.place, data)
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


def _keep(told: Told, place: ReckonedPose | None, data: RunData) -> None:
    match told:
        case AnomalyBegan(kind=kind) if kind in ANOMALY_KINDS:
            data.onsets.append(told)
        case Event() | Silence():
            data.events.append(told)
        case Fix():
            here_m = (place.north_m, place.east_m) if place else (nan, nan)
            where = told.latitude_deg, told.longitude_deg, or_nan(told.error_m)
            data.fixes.append(MapFix(told.elapsed_s, *where, *here_m))
        case EpisodeBegan():
            data.episodes.append(told.episode)


def _columns(names: Sequence[str], flat: array[float]) -> Columns:
    """Return the columns of rows that stand one after the other."""
    return dict(zip(names, np.array(flat).reshape(-1, len(names)).T, strict=True))
