"""Reads a run's log for its report: once, as a stream, and despite damage."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from math import nan
from pathlib import Path

import numpy as np

from wayfarer.escape.api import Anomaly
from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.episodes import EpisodeBegan
from wayfarer.fieldlog.fields import number
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.run_events import AnomalyBegan, Noted, Silence
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.typed import Board, Fix, RunEvent, Tick, Truth, or_nan
from wayfarer.views.run_report.data import LEVEL_NUMBERS, PHASES, Columns, MapFix, RunData
from wayfarer.views.text.summary import RunSummariser

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
