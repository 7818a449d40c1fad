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
from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.fields import number, or_nan
from wayfarer.fieldlog.missions import Episode, EpisodeBegan
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.run_events import AnomalyBegan, Noted, Silence
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.typed import Board, Fix, Header, RunEvent, Tick, Truth
from wayfarer.safety.conditions import Level
from wayfarer.views.receiver_fit import MapFix
from wayfarer.views.text.summary import RunSummariser, RunSummary

Floats = NDArray[np.float64]
Columns = Mapping[str, Floats]

PHASES = tuple(phase.value for phase in Phase)
LEVEL_NUMBERS = {level.name.lower(): float(level) for level in Level}
ANOMALY_KINDS = frozenset(anomaly.value for anomaly in Anomaly)
PHASE_INDEX = {phase: float(index) for index, phase in enumerate(PHASES)}
TICK: Mapping[str, Callable[[Tick], float | None]] = {
    "t_s": lambda tick: tick.elapsed_s,
    "phase": lambda tick: PHASE_INDEX.get(tick.phase or ""),
    "level": lambda tick: LEVEL_NUMBERS.get(tick.level or ""),
    "heading_deg": lambda tick: tick.heading_deg,
    "goal_heading_deg": lambda tick: tick.goal_heading_deg,
    "counter_deg": lambda tick: tick.counter_deg,
    "pitch_deg": lambda tick: tick.pitch_deg,
    "roll_deg": lambda tick: tick.roll_deg,
    "wanted_left": lambda tick: number(tick.record, "wanted_left"),
    "wanted_right": lambda tick: number(tick.record, "wanted_right"),
    "left": lambda tick: tick.applied_left or 0.0,
    "right": lambda tick: tick.applied_right or 0.0,
    "measured_m_s": lambda tick: tick.measured_m_s,
    "period_s": lambda tick: tick.period_s,
    "north_m": lambda tick: tick.place.north_m if tick.place else nan,
    "east_m": lambda tick: tick.place.east_m if tick.place else nan,
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

    header: Record = field(default_factory=dict)
    summary: RunSummary = field(init=False)
    damage: Damage = field(init=False)
    ticks: Columns = field(default_factory=dict)
    further: Columns = field(default_factory=dict)
    truth: Columns = field(default_factory=dict)
    sensors: Mapping[str, SensorStatus] = field(default_factory=dict)
    batteries: Columns = field(default_factory=dict)
    onsets: list[AnomalyBegan] = field(default_factory=list)
    events: list[Noted | Silence] = field(default_factory=list)
    fixes: list[MapFix] = field(default_factory=list)
    episodes: list[Episode] = field(default_factory=list)

    @property
    def has_way(self) -> bool:
        """Return whether anybody can say where the rover went."""
        return bool(self.fixes) or not bool(np.isnan(self.ticks["north_m"]).all())

    @property
    def goals(self) -> list[tuple[float, float]]:
        """Return when the rover took each goal, and its heading in degrees.

        Of a log that begins after the first one, it is that of the first tick in which an algorithm drives: the ticks
        of a disarmed rover, and of one that a person drives, have a goal that nobody gave.
        """
        events = [event for event in self.events if isinstance(event, Noted) and event.name in {"armed", "goal"}]
        if events:
            told = ((event.elapsed_s, number(event.record, "goal_heading_deg")) for event in events)
            return [(t_s, goal_deg) for t_s, goal_deg in told if goal_deg is not None]
        nobody = [PHASE_INDEX[phase.value] for phase in (Phase.HALT, Phase.MANUAL)]
        known = ~np.isnan(self.ticks["goal_heading_deg"]) & ~np.isin(self.ticks["phase"], nobody)
        return list(zip(*(self.ticks[name][known][:1].tolist() for name in ("t_s", "goal_heading_deg")), strict=True))

    def setting(self, section: str, key: str) -> float:
        """Return a number of the rover file, NaN if the header does not have it."""
        return or_nan(Header.of(self.header).setting(section, key))


def read_run(run: Path) -> RunData:
    """Read what a report shows of the run in a folder.

    Raises:
        BadInput: there is no log in it, or nothing of it can be read.
    """
    reader, fold, summariser = RunReader(run), RunFold(), RunSummariser()
    data, ticks, truths, batteries = RunData(), array("d"), array("d"), array("d")
    further: dict[str, array[float]] = {}
    for record in reader:
        events = fold.take(record)
        summariser.take(events)
        for event in events:
            match event:
                case Tick():
                    ticks.extend(or_nan(column(event)) for column in TICK.values())
                    ticks.append(fold.state.stretch)
                    _add_further(event, fold.state.ticks, further)
                case Truth():
                    phase = or_nan(PHASE_INDEX.get(fold.state.tick.phase or ""))
                    truths.extend((event.elapsed_s, event.x_m, event.y_m, phase, fold.state.stretch))
                case Board(battery_v=battery_v) if battery_v is not None:
                    batteries.extend((event.elapsed_s, battery_v, event.period_s, fold.state.stretch))
                case _:
                    _keep(event, fold.state.place, data)
    state = fold.state
    data.header, data.summary, data.damage = state.header.record, summariser.summary(state), reader.damage
    data.ticks, data.truth = _columns([*TICK, "stretch"], ticks), _columns(TRUTH, truths)
    data.batteries = _columns(BATTERY, batteries)
    data.further = {key: np.array(column) for key, column in further.items()}
    data.sensors = {name: each for name, each in sorted(state.sensors.items()) if each.readings or each.failures}
    for sensor in data.sensors.values():
        sensor.fell_silent(state.t_s)
    return data


def _add_further(tick: Tick, count: int, further: dict[str, array[float]]) -> None:
    """Add to each column the number that a tick has under its key; one that is new has none in the ticks before."""
    values = {key: value for key in tick.further if (value := number(tick.record, key)) is not None}
    for key in values:
        if len(further) < FURTHER_MOST:
            further.setdefault(key, array("d", [nan]) * (count - 1))
    for key, column in further.items():
        column.append(values.get(key, nan))


def _keep(event: RunEvent, place: ReckonedPose | None, data: RunData) -> None:
    match event:
        case AnomalyBegan(kind=kind) if kind in ANOMALY_KINDS:
            data.onsets.append(event)
        case Noted() | Silence():
            data.events.append(event)
        case Fix():
            here_m = (place.north_m, place.east_m) if place else (nan, nan)
            where = event.latitude_deg, event.longitude_deg, or_nan(event.error_m)
            data.fixes.append(MapFix(event.elapsed_s, *where, *here_m))
        case EpisodeBegan():
            data.episodes.append(event.episode)


def _columns(names: Sequence[str], flat: array[float]) -> Columns:
    """Return the columns of rows that stand one after the other."""
    return dict(zip(names, np.array(flat).reshape(-1, len(names)).T, strict=True))
