"""Reads a run's log for its report: once, as a stream, and despite damage."""

from __future__ import annotations

from array import array
from collections import defaultdict
from math import isnan, nan
from pathlib import Path
from typing import Any

from wayfarer.escape.api import Phase
from wayfarer.fieldlog.dead_reckoning import QUALITY_MIN, ReckonedPose
from wayfarer.fieldlog.fields import name, names, reckoning, sound_tick
from wayfarer.fieldlog.reader import Damage, Record, RunReader
from wayfarer.views.run_report.data import (
    ANOMALIES,
    GAP_S,
    LEVELS,
    PHASES,
    Episode,
    LoggedEvent,
    MapFix,
    Onset,
    RunData,
    Sensor,
    Tick,
    TruePose,
    columns,
    number,
)  # fmt: skip
from wayfarer.views.text.run_summariser import RunSummariser
from wayfarer.views.text.verdict import readable
from wayfarer.views.text.wording import event_name

SIDES = {1.0: "right", -1.0: "left"}  # tau: clockwise is to the right
TURN_AWAY = PHASES.index(Phase.TURN_AWAY.value)


def read_run(run: Path) -> RunData:
    """Read what a report shows of the run in a folder.

    Raises:
        BadInput: there is no log in it, or nothing of it can be read.
    """
    reader, reading = RunReader(run), _Reading()
    for record in readable(reader):
        reading.take(record)
    return reading.finish(reader.damage)


class _Reading:
    """Takes the records in their order; what the summary tells as well is left to it."""

    def __init__(self) -> None:
        self.data = RunData()
        self._takers = {
            "run": self._header, "tick": self._tick, "event": self._event, "position": self._position,
            "board": self._board, "truth": self._truth,
        }  # fmt: skip
        self._summariser = RunSummariser()
        self._reckoning = reckoning({})
        self._sensors: defaultdict[str, Sensor] = defaultdict(Sensor)
        self._ticks, self._truths = array("d"), array("d")
        self._first_t_s = self._max_speed_m_s = nan
        self._number: int | None = None
        self._stretch = 0.0
        self._tick_t_s = self._motion_t_s = nan  # of the one before, NaN where records are missing since
        self._phase = nan
        self._wrong: frozenset[str] = frozenset()
        self._episode: Episode | None = None
        self._marks = 0

    def take(self, record: Record) -> None:
        """Take the next record."""
        self._summariser.take(record)
        self._note_missing(record.get("n"))
        if isnan(self._first_t_s):
            self._first_t_s = float(record["t_s"])
        if taker := self._takers.get(record["record"]):
            taker(record["t_s"] - self._first_t_s, record)

    def finish(self, damage: Damage) -> RunData:
        """Return what was read."""
        self._end_episode(None)
        data = self.data
        data.summary, data.damage = self._summariser.summary(), damage
        data.ticks, data.truth = columns(Tick, self._ticks), columns(TruePose, self._truths)
        data.sensors = dict(sorted(self._sensors.items()))
        for sensor in data.sensors.values():  # one that fell silent for good has a gap up to the end
            sensor.longest_gap_s = max(sensor.longest_gap_s, data.summary.lasted_s - sensor.last_t_s)
        return data

    def _note_missing(self, count: object) -> None:
        """Forget what two records that do not follow each other would be compared by."""
        if isinstance(count, int):
            if self._number is not None and count != self._number + 1:
                self._stretch += 1.0
                self._tick_t_s = self._motion_t_s = nan
                for sensor in self._sensors.values():
                    sensor.last_t_s = nan
            self._number = count

    def _header(self, _since_s: float, header: Record) -> None:
        if not self.data.header:
            self.data.header = header
            self._reckoning = reckoning(header)
            self._max_speed_m_s = self.data.setting("vehicle", "max_speed_m_s")

    # -- ticks ---------------------------------------------------------------------------------------------------

    def _tick(self, since_s: float, record: Record) -> None:
        left, right = _duty(record.get("applied_left")), _duty(record.get("applied_right"))
        commanded_m_s = (left + right) / 2.0 * self._max_speed_m_s
        sound, phase = sound_tick(record), record.get("phase")
        place = self._reckoning.take(sound)
        north_m, east_m = _metres(place)
        self._follow_episode(since_s, phase, record)
        self._phase = float(PHASES.index(phase)) if phase in PHASES else nan
        tick = Tick(
            t_s=since_s,
            phase=self._phase,
            level=LEVELS.get(str(record.get("level")), nan),
            heading_deg=number(record.get("heading_deg")),
            goal_heading_deg=number(record.get("goal_heading_deg")),
            counter_deg=number(record.get("counter_deg")),
            pitch_deg=number(record.get("pitch_deg")),
            roll_deg=number(record.get("roll_deg")),
            commanded_m_s=commanded_m_s,
            measured_m_s=self._measured_m_s(since_s, sound.get("motion"), commanded_m_s),
            duty=(abs(left) + abs(right)) / 2.0,
            period_s=since_s - self._tick_t_s,
            north_m=north_m,
            east_m=east_m,
            stretch=self._stretch,
        )
        self._ticks.extend(tick)
        self._tick_t_s = since_s
        for sensor in ("compass", "motion", "contact"):
            self._listen(sensor, record.get(sensor))
        self._note_anomalies(since_s, frozenset(names(record, "anomalies")) & ANOMALIES, place)

    def _measured_m_s(self, since_s: float, motion: dict[str, Any] | None, commanded_m_s: float) -> float:
        """Return the speed that the motion sensor measured, NaN where it said nothing that can be used."""
        if motion is None:
            return nan
        before_s, self._motion_t_s = self._motion_t_s, since_s
        forward_m, dt_s = number(motion["forward_m"]), since_s - before_s
        if isnan(forward_m) or (motion["quality"] or 0.0) < QUALITY_MIN:
            self._sensors["motion"].doubtful += 1
            return nan
        if not 0.0 < dt_s < GAP_S:
            return nan
        speed_m_s = forward_m / dt_s
        return -speed_m_s if not motion["signed"] and commanded_m_s < 0.0 else speed_m_s

    def _listen(self, sensor_name: str, reading: object) -> None:
        """Note when a sensor spoke; a tick repeats the last reading until there is a new one."""
        if not isinstance(reading, dict) or isnan(t_s := number(reading.get("t_s"))):
            return
        sensor, since_s = self._sensors[sensor_name], t_s - self._first_t_s
        if since_s == sensor.last_t_s:
            return
        sensor.readings += 1
        gap_s = since_s - sensor.last_t_s
        if gap_s > 0.0:
            sensor.gaps += 1
            sensor.spoken_s += gap_s
            sensor.longest_gap_s = max(sensor.longest_gap_s, gap_s)
        sensor.last_t_s = since_s

    def _note_anomalies(self, since_s: float, wrong: frozenset[str], place: ReckonedPose | None) -> None:
        for kind in sorted(wrong - self._wrong):
            self.data.onsets.append(Onset(since_s, kind, *_metres(place)))
        self._wrong = wrong

    # -- episodes ------------------------------------------------------------------------------------------------

    def _follow_episode(self, since_s: float, phase: object, record: Record) -> None:
        """Begin or end an episode. A hold interrupts it; following the goal, or re-arming, ends it."""
        episode = self._episode
        if phase == Phase.FOLLOW.value:
            if episode is not None:
                episode.end_s = since_s
                self._end_episode(name(record, "why"))
        elif phase in PHASES and phase != Phase.HALT.value:
            if episode is None:
                side = SIDES.get(number(record.get("side")), "")
                episode = self._episode = Episode(since_s, side, since_s, self._reckoning.path_m)
                self.data.episodes.append(episode)
            episode.turns += phase == Phase.TURN_AWAY.value and self._phase != TURN_AWAY
            episode.end_s = since_s

    def _end_episode(self, why: str | None) -> None:
        if self._episode is not None:
            self._episode.metres = self._reckoning.path_m - self._episode.metres
            self._episode.ended_by = why
            self._episode = None

    # -- everything else -----------------------------------------------------------------------------------------

    def _event(self, since_s: float, record: Record) -> None:
        what = event_name(record)
        self._marks += what == "mark"
        mark = self._marks if what == "mark" else 0
        self.data.events.append(LoggedEvent(since_s, what, record, mark, *_metres(self._reckoning.place)))
        if what in ("armed", "disarmed"):
            self._end_episode(what)
        if what == "sensor_failed":
            self._sensors[name(record, "sensor") or "unknown"].failures += 1

    def _position(self, since_s: float, record: Record) -> None:
        self._listen("position", record)
        latitude_deg, longitude_deg = number(record.get("latitude_deg")), number(record.get("longitude_deg"))
        if abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0:
            place, error_m = self._reckoning.place, number(record.get("error_m"))
            self.data.fixes.append(MapFix(since_s, latitude_deg, longitude_deg, error_m, *_metres(place)))

    def _board(self, since_s: float, record: Record) -> None:
        if not isnan(battery_v := number(record.get("battery_v"))):
            self.data.batteries.append((since_s, battery_v))

    def _truth(self, since_s: float, record: Record) -> None:
        truth = TruePose(since_s, number(record.get("x_m")), number(record.get("y_m")), self._phase, self._stretch)
        if not isnan(truth.x_m + truth.y_m):
            self._truths.extend(truth)


def _duty(value: object) -> float:
    """Return a duty; what cannot be one is none."""
    duty = number(value)
    return duty if -1.0 <= duty <= 1.0 else 0.0


def _metres(place: ReckonedPose | None) -> tuple[float, float]:
    return (number(place.north_m), number(place.east_m)) if place else (nan, nan)
