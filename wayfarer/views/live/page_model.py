"""The model of the page, built from log records: a full copy for a new viewer, changes for the others. Pure.

Three things come out. The *snapshot* is everything that a page shows. *News* must not be missed: a piece of the way, an
anomaly, a line about the run, the end. The *state* is how things are now; a viewer that is slow gets only the newest.

Metres are east and north: of the start where the rover only knows what it dead-reckons, of the forest where the run is
simulated and so the truth is known.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from typing import Any

from wayfarer.fieldlog.fields import name, names, number, reckoning, sound_tick, table
from wayfarer.fieldlog.log import Record
from wayfarer.views.live.log_lines import LogLines, page_line
from wayfarer.views.live.sensor_status import SensorStatus
from wayfarer.views.trail import Trail
from wayfarer.views.vocabulary import ANOMALIES, CAUSES, PHASES, because, level_text, reason_text

LINES = 200  # about the run; half an hour of a rover that drives
MARKS = 400  # anomalies that are drawn; the oldest go first
PHASES_KEPT = 400
TRACK_POINTS = 3000  # some 75 kB for a new viewer; 150 m at the first spacing, 1.2 km at the fourth
TRACK_SPACING_M = 0.05  # less than the line is wide

# Nobody reads a bumper that no decision uses: it appears on the page when it first speaks.
SENSORS = ("compass", "motion", "position")


class PageModel:
    """Takes the records of one run in their order.

    Nothing that a third party's algorithm writes into a record may break it; a value that is missing is None.
    """

    def __init__(self) -> None:
        self._log_lines = LogLines()
        self._trail = Trail(TRACK_POINTS, TRACK_SPACING_M)
        self._lines: deque[list[str]] = deque(maxlen=LINES)
        self._marks: deque[list[Any]] = deque(maxlen=MARKS)
        self._phases: deque[list[Any]] = deque(maxlen=PHASES_KEPT)
        self._counts: Counter[str] = Counter()
        self._news: dict[str, Any] = {}
        self._about: Record = {}
        self._forest: Record | None = None
        self._outcome: Record | None = None
        self._sensor_statuses: dict[str, SensorStatus] = {}
        self._tick: Record = {}
        self._board: Record = {}
        self._mode, self._why_disarmed, self._held = "disarmed", "not armed since the start", False
        self._goal_deg: float | None = None
        self._why = ""
        self._anomalies: tuple[str, ...] = ()
        self._place: tuple[float, float, float] | None = None
        self._t_s = 0.0
        self._mission_t_s: float | None = None
        self._mission_s = self._mission_m = self._from_m = 0.0
        self._takers: dict[str, Callable[[Record], None]] = {
            "run": self._take_run,
            "tick": self._take_tick,
            "truth": self._take_truth,
            "event": self._take_event,
            "position": lambda fix: self._pulse("position").take(fix),
            "board": self._take_board,
            "outcome": self._take_outcome,
        }

    def take(self, record: Record) -> bool:
        """Take a record; return whether people should see it at once, not at the next regular moment."""
        self._t_s = record["t_s"]
        take = self._takers.get(record["record"])
        if take is not None:
            take(record)
        for line in self._log_lines.take(record):
            self._tell("lines", self._lines, page_line(line))
        return record["record"] in {"event", "outcome"}

    def snapshot(self) -> dict[str, Any]:
        """Return everything that a page shows."""
        return {
            "about": self._about,
            "forest": self._forest,
            "track": list(self._trail.points),
            "marks": list(self._marks),
            "phases": list(self._phases),
            "lines": list(self._lines),
            "outcome": self._outcome,
            "state": self.state(),
        }

    def news(self) -> dict[str, Any]:
        """Return what is new since the last call, empty where nothing is; each viewer must get all of it, in order."""
        if self._trail.thin():
            self._news["whole_track"] = list(self._trail.points)
            self._news.pop("track", None)
        news, self._news = self._news, {}
        return news

    def state(self) -> dict[str, Any]:
        """Return how things are now."""
        tick = self._tick
        phase, level, cause = name(tick, "phase") or "", name(tick, "level") or "", name(tick, "cause")
        return {
            "t_s": round(self._t_s, 3),
            "mode": self._mode,
            "why_disarmed": self._why_disarmed,
            "held": self._held,
            "phase": phase,
            "phase_text": PHASES.get(phase, phase),
            "why_text": self._why,
            "level": level,
            "level_text": level_text(level, cause),
            "cause_text": CAUSES.get(cause, cause) if cause else "",
            **{key: number(tick, key) for key in ("heading_deg", "pitch_deg", "roll_deg", "counter_deg", "episodes")},
            "goal_heading_deg": self._goal_deg,
            "anomalies": [ANOMALIES.get(each, each) for each in self._anomalies],
            "counts": [[ANOMALIES.get(kind, kind), count] for kind, count in self._counts.most_common()],
            "wheels": [number(tick, "applied_left"), number(tick, "applied_right")],
            "mission_s": round(self._mission_s, 1),
            "mission_m": round(self._mission_m, 2),
            "battery_v": number(self._board, "battery_v"),
            "faults": list(self._board.get("faults", ())),
            "sensors": [[sensor, pulse.now(self._t_s)] for sensor, pulse in self._sensor_statuses.items()],
            "place": self._place,
        }

    # -- records -------------------------------------------------------------------------------------------------

    def _take_run(self, header: Record) -> None:
        self._config = table(header, "config")
        vehicle, parts = table(self._config, "vehicle"), table(header, "parts")
        told = {key: header.get(key) for key in ("rover", "algorithm", "version", "simulated", "dry_run")}
        size = {key: number(vehicle, key) for key in ("length_m", "width_m")}
        self._about = {**told, **size}
        self._forest = _forest(table(header, "world"))
        self._reckoning = reckoning(header)
        for sensor in SENSORS:
            if sensor in parts:
                self._pulse(sensor)

    def _take_tick(self, tick: Record) -> None:
        for sensor in ("compass", "motion", "contact"):
            if tick.get(sensor):
                self._pulse(sensor).take(tick[sensor])
        phase, before = name(tick, "phase") or "", name(self._tick, "phase")
        fresh = set(names(tick, "anomalies")) - set(self._anomalies)
        self._tick, self._anomalies = tick, names(tick, "anomalies")
        if phase != before:
            why = name(tick, "why") or ""
            self._why = because(why, self._anomalies) if why != phase else ""
            self._tell("phases", self._phases, [round(self._t_s, 2), phase])
        reckoned = self._reckoning.take(sound_tick(tick))
        if self._forest is None and reckoned is not None:
            self._move(reckoned.east_m, reckoned.north_m, reckoned.heading_deg)
        self._note_anomalies(fresh)
        self._count_mission(tick)

    def _take_truth(self, truth: Record) -> None:
        self._move(truth["x_m"], truth["y_m"], truth["heading_deg"])

    def _take_event(self, event: Record) -> None:
        what = event["name"]
        if what in {"arming", "armed", "disarmed"}:
            self._mode = what
        if what == "disarmed":
            self._why_disarmed = reason_text(name(event, "reason") or "")
            self._mission_t_s = None
        elif what in {"arming", "hold", "resume"}:
            self._held = what == "hold"
        elif what == "armed":
            self._mission_t_s, self._from_m = self._t_s, number(self._tick, "travelled_m") or 0.0
        elif what == "sensor_failed":
            self._pulse(event["sensor"]).fail()
        if what in {"armed", "goal"}:
            self._goal_deg = number(event, "goal_heading_deg")

    def _take_board(self, board: Record) -> None:
        self._board = board

    def _take_outcome(self, outcome: Record) -> None:
        self._mode = "ended"
        self._outcome = self._news["outcome"] = {key: name(outcome, key) for key in ("reason", "text")}

    # -- what it means -------------------------------------------------------------------------------------------

    def _pulse(self, sensor: str) -> SensorStatus:
        if sensor not in self._sensor_statuses:
            rates, detector = table(self._config, "rates"), table(self._config, "detector")
            self._sensor_statuses[sensor] = SensorStatus(
                number(rates, f"{sensor}_hz"), number(detector, f"{sensor}_stale_s")
            )
        return self._sensor_statuses[sensor]

    def _move(self, east_m: float, north_m: float, heading_deg: float) -> None:
        self._place = (round(east_m, 3), round(north_m, 3), round(heading_deg, 1))
        if self._trail.add(*self._place[:2], name(self._tick, "phase") or ""):
            self._news.setdefault("track", []).append(self._trail.points[-1])

    def _note_anomalies(self, fresh: set[str]) -> None:
        self._counts.update(fresh)
        if self._place is not None:
            for kind in sorted(fresh):
                self._tell("marks", self._marks, [*self._place[:2], ANOMALIES.get(kind, kind)])

    def _count_mission(self, tick: Record) -> None:
        if self._mission_t_s is not None:
            self._mission_s = self._t_s - self._mission_t_s
            self._mission_m = (number(tick, "travelled_m") or self._from_m) - self._from_m

    def _tell(self, what: str, kept: deque[Any], told: list[Any]) -> None:
        kept.append(told)
        self._news.setdefault(what, []).append(told)


def _forest(world: Record) -> Record | None:
    """Return what a page draws of a simulated forest, None where there is none."""
    keys = ("start_m", "goal_y_m", "trunk_diameter_m", "tree_radius_m", "trees_m", "trunks_m")
    return {key: world[key] for key in keys} if all(key in world for key in keys) else None
