"""The model of the page, built from log records: a full copy for a new viewer, changes for the others. Pure.

Three things come out. The *snapshot* is everything that a page shows. *News* must not be missed: a piece of the path,
an anomaly, a line about the run, the end. The *state* is how things are now; a slow viewer gets only the newest.

Metres are east and north: of the start where the rover only knows what it dead-reckons, of the forest where the run is
simulated and so the truth is known.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from wayfarer.angles import wrap180
from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.record import AnyRecord, Event, Header, Outcome, Tick, Truth
from wayfarer.fieldlog.run_fold import AnomalyBegan, PhaseChanged, RunBegan, RunFold, Told
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.logview.run_narrator import RunNarrator, Verbosity, further_texts, reason_text
from wayfarer.logview.trail import Trail
from wayfarer.vocabulary import disarmed_text, in_words, level_text, response_text

LINES = 200  # about the run; half an hour of a rover that drives
MARKS = 400  # anomalies that are drawn; the oldest go first
PHASES_KEPT = 400
COURSE_POINTS = 600  # of heading and C over time; the page shows two minutes of them
COURSE_S = 0.175  # between two of them at least: every fourth tick at 20 Hz
FURTHER_CHARS = 500  # of what else a tick says; what a third party's algorithm remembers has no bound
TRACK_POINTS = 3000  # some 75 kB for a new viewer; 150 m at the first spacing, 1.2 km at the fourth
TRACK_SPACING_M = 0.05  # less than the line is wide


class PageModel:
    """Takes the records of one run in their order.

    Nothing that a third party's algorithm writes into a record may break it; a value that is missing is None.
    """

    def __init__(self) -> None:
        self._fold = RunFold()
        self._narrator = RunNarrator(Verbosity.CHANGES)
        self._trail = Trail(TRACK_POINTS, TRACK_SPACING_M)
        self._lines: deque[list[str]] = deque(maxlen=LINES)
        self._marks: deque[list[Any]] = deque(maxlen=MARKS)
        self._phases: deque[list[Any]] = deque(maxlen=PHASES_KEPT)
        self._course: deque[list[Any]] = deque(maxlen=COURSE_POINTS)
        self._news: dict[str, Any] = {}
        self._about: dict[str, Any] = {}
        self._why = ""
        self._place: tuple[float, float, float] | None = None

    def take(self, record: AnyRecord) -> bool:
        """Take a record; return whether people should see it at once, not at the next regular moment."""
        run = self._fold.state
        was = run.mode, run.tick.held
        events = self._fold.take(record)
        for event in events:
            self._take(event)
        for line in self._narrator.tell(events):
            self._tell("lines", self._lines, [duration_text(line.elapsed_s, 1), line.text, line.tone.value])
        return isinstance(record, Event) or (run.mode, run.tick.held) != was

    def snapshot(self) -> dict[str, Any]:
        """Return everything that a page shows."""
        return {
            "about": self._about,
            "forest": self._fold.state.header.world,
            "track": list(self._trail.points),
            "marks": list(self._marks),
            "phases": list(self._phases),
            "course": list(self._course),
            "lines": list(self._lines),
            "outcome": _outcome(self._fold.state.ended),
            "state": self.state(),
        }

    def news(self) -> dict[str, Any]:
        """Return what is new since the last call, empty if nothing is; each viewer must get all of it, in order."""
        if self._trail.thin():
            self._news["whole_track"] = list(self._trail.points)
            self._news.pop("track", None)
        news, self._news = self._news, {}
        return news

    def state(self) -> dict[str, Any]:
        """Return how things are now."""
        run = self._fold.state
        tick, phase, level = run.tick, run.tick.phase, run.tick.level
        return {
            "t_s": round(run.t_s, 3),
            "mode": run.mode,
            "why_disarmed": disarmed_text(run.why_disarmed),
            "held": tick.held,
            "phase": phase,
            "phase_text": in_words(phase),
            "why_text": self._why,
            "level": level,
            "level_text": level_text(level, tick.cause),
            "cause_text": in_words(tick.cause) if tick.cause else "",
            "cause_for_s": round(run.elapsed_s - run.cause_since_s, 1) if tick.cause else None,
            "response_text": response_text(tick.level, tick.cause) if run.mode == "armed" else "",
            "heading_deg": tick.heading_deg,
            "pitch_deg": tick.pitch_deg,
            "roll_deg": tick.roll_deg,
            "counter_deg": tick.remembered("counter_deg"),
            "episodes": tick.remembered("episodes"),
            "further": ", ".join(further_texts(tick))[:FURTHER_CHARS],
            "goal_heading_deg": tick.goal_heading_deg,
            "anomalies": [in_words(kind) for kind in tick.anomalies],
            "counts": [[in_words(kind), count] for kind, count in run.anomalies.most_common()],
            "wheels": [tick.applied_left, tick.applied_right],
            **self._totals(),
            "battery_v": None if run.board is None else run.board.battery_v,
            "faults": [] if run.board is None else list(run.board.faults),
            "sensors": [[name, _sensor(sensor, run.t_s)] for name, sensor in run.sensors.items()],
            "place": self._place,
        }

    def _totals(self) -> dict[str, Any]:
        """Return time and way, as all other views tell them, and from when or by whom they are counted."""
        run = self._fold.state
        in_trial, knows_way = run.header.trial is not None, run.driven_m is not None
        return {
            "time_text": duration_text(run.elapsed_s if in_trial else run.mission_s),
            "time_of": "in all" if in_trial else "mission",
            "way_m": run.driven_m if knows_way else round(run.mission_m, 2),
            "way_of": "driven" if knows_way else "commanded",
        }

    # -- what happened -------------------------------------------------------------------------------------------

    def _take(self, event: Told) -> None:
        if isinstance(event, Tick):
            self._follow_course(event)
        match event:
            case Tick() if (place := event.place) is not None and self._fold.state.header.world is None:
                self._move(place.east_m, place.north_m, place.heading_deg)
            case Truth():
                self._move(event.x_m, event.y_m, event.heading_deg)
            case PhaseChanged():
                self._why = reason_text(self._fold.state.tick)
                self._tell("phases", self._phases, [round(event.t_s, 2), event.phase])
            case AnomalyBegan(kind=kind) if self._place is not None:
                self._tell("marks", self._marks, [*self._place[:2], in_words(kind)])
            case RunBegan(header=header):
                self._about = _about(header)
            case Outcome():
                self._news["outcome"] = _outcome(event)

    def _follow_course(self, tick: Tick) -> None:
        """Keep the heading relative to the goal, clockwise positive, and C; None for what is not known."""
        if self._course and 0.0 <= tick.t_s - self._course[-1][0] < COURSE_S:
            return
        goal_deg, heading_deg, counter_deg = tick.goal_heading_deg, tick.heading_deg, tick.remembered("counter_deg")
        off_deg = None if goal_deg is None or heading_deg is None else round(wrap180(heading_deg - goal_deg), 1)
        told_c_deg = None if counter_deg is None else round(counter_deg, 1)
        self._tell("course", self._course, [round(tick.t_s, 2), off_deg, told_c_deg])

    def _move(self, east_m: float, north_m: float, heading_deg: float) -> None:
        self._place = (round(east_m, 3), round(north_m, 3), round(heading_deg, 1))
        if self._trail.add(*self._place[:2], self._fold.state.tick.phase):
            self._news.setdefault("track", []).append(self._trail.points[-1])

    def _tell(self, what: str, kept: deque[Any], told: list[Any]) -> None:
        kept.append(told)
        self._news.setdefault(what, []).append(told)


def _about(header: Header) -> dict[str, Any]:
    """Return what a page says of the rover."""
    return {
        "rover": header.rover,
        "algorithm": header.algorithm,
        "version": header.version,
        "simulated": header.simulated,
        "dry_run": header.dry_run,
        "manual": (header.config or {}).get("manual", {}).get("allowed") is True,
        "length_m": header.setting("vehicle", "length_m"),
        "width_m": header.setting("vehicle", "width_m"),
    }


def _outcome(ended: Outcome | None) -> dict[str, str | None] | None:
    return None if ended is None else {"reason": ended.reason, "text": ended.text}


def _sensor(sensor: SensorStatus, t_s: float) -> dict[str, Any]:
    """Return how a sensor does; ``age_s`` is None if it has never spoken."""
    age_s, rate_hz = sensor.age_s(t_s), sensor.rate_now_hz
    return {
        "age_s": None if age_s is None else round(age_s, 2),
        "rate_hz": None if rate_hz is None else round(rate_hz, 1),
        "wanted_hz": sensor.wanted_hz,
        "late": sensor.is_late(t_s),
        "failures": sensor.failures,
        "note": sensor.note,
    }
