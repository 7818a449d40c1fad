"""Reads a run's log for its report: once, as a stream, and despite damage."""

from __future__ import annotations

from array import array
from math import nan
from pathlib import Path

from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.episodes import EpisodeBegan
from wayfarer.fieldlog.reader import Damage, Record, RunReader
from wayfarer.fieldlog.run_events import AnomalyBegan, Marked, Noted, RunBegan
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.typed import Board, Fix, RunEvent, Truth, or_nan
from wayfarer.fieldlog.typed import Tick as LoggedTick
from wayfarer.views.run_report.data import (
    ANOMALIES,
    LEVELS,
    PHASES,
    LoggedEvent,
    MapFix,
    Onset,
    RunData,
    Tick,
    TruePose,
    columns,
)
from wayfarer.views.text.run_summariser import RunSummariser

PHASE_INDEX = {phase: float(index) for index, phase in enumerate(PHASES)}


def read_run(run: Path) -> RunData:
    """Read what a report shows of the run in a folder.

    Raises:
        BadInput: there is no log in it, or nothing of it can be read.
    """
    reader, reading = RunReader(run), _Reading()
    for record in reader:
        reading.take(record)
    return reading.finish(reader.damage)


class _Reading:
    """Takes the records in their order, and lays what the fold makes of them out for drawing."""

    def __init__(self) -> None:
        self.data = RunData()
        self._fold = RunFold()
        self._summariser = RunSummariser()
        self._ticks, self._truths = array("d"), array("d")
        self._phase = self._max_speed_m_s = nan

    def take(self, record: Record) -> None:
        """Take the next record."""
        events = self._fold.take(record)
        self._summariser.take(events)
        for event in events:
            self._take(event)

    def finish(self, damage: Damage) -> RunData:
        """Return what was read."""
        data, state = self.data, self._fold.state
        data.summary, data.damage = self._summariser.summary(state), damage
        data.ticks, data.truth = columns(Tick, self._ticks), columns(TruePose, self._truths)
        data.sensors = {name: each for name, each in sorted(state.sensors.items()) if each.readings or each.failures}
        for sensor in data.sensors.values():
            sensor.fell_silent(state.t_s)
        return data

    def _take(self, event: RunEvent) -> None:
        data, stretch = self.data, float(self._fold.state.gaps)
        match event:
            case LoggedTick():
                self._ticks.extend(self._drawn(event, stretch))
            case Truth():
                self._truths.extend(TruePose(event.elapsed_s, event.x_m, event.y_m, self._phase, stretch))
            case Board(battery_v=battery_v) if battery_v is not None:
                data.batteries.append((event.elapsed_s, battery_v))
            case AnomalyBegan(kind=kind) if kind in ANOMALIES:
                data.onsets.append(Onset(event.elapsed_s, kind))
            case Noted(name=name):
                mark = event.number if isinstance(event, Marked) else 0
                data.events.append(LoggedEvent(event.elapsed_s, name, event.record, mark))
            case Fix():
                error_m, here_m = or_nan(event.error_m), _metres(self._fold.state.place)
                data.fixes.append(MapFix(event.elapsed_s, event.latitude_deg, event.longitude_deg, error_m, *here_m))
            case EpisodeBegan():
                data.episodes.append(event.episode)
            case RunBegan(header=header):
                data.header = header.record
                self._max_speed_m_s = or_nan(header.setting("vehicle", "max_speed_m_s"))

    def _drawn(self, tick: LoggedTick, stretch: float) -> Tick:
        left, right = tick.applied_left or 0.0, tick.applied_right or 0.0
        north_m, east_m = _metres(tick.place)
        self._phase = PHASE_INDEX.get(tick.phase or "", nan)
        return Tick(
            t_s=tick.elapsed_s,
            phase=self._phase,
            level=LEVELS.get(tick.level or "", nan),
            heading_deg=or_nan(tick.heading_deg),
            goal_heading_deg=or_nan(tick.goal_heading_deg),
            counter_deg=or_nan(tick.counter_deg),
            pitch_deg=or_nan(tick.pitch_deg),
            roll_deg=or_nan(tick.roll_deg),
            commanded_m_s=(left + right) / 2.0 * self._max_speed_m_s,
            measured_m_s=tick.measured_m_s,
            duty=(abs(left) + abs(right)) / 2.0,
            period_s=tick.period_s,
            north_m=north_m,
            east_m=east_m,
            stretch=stretch,
        )


def _metres(place: ReckonedPose | None) -> tuple[float, float]:
    return (place.north_m, place.east_m) if place else (nan, nan)
