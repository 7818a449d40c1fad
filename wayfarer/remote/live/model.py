"""What the page shows, built from log records, and how it is sent to many viewers.

Three things come out of ``PageModel``. The *snapshot* is everything that a page shows. *News* must not be missed: a
piece of the path, an anomaly, a line about the run, the end. The *state* is how things are now; a slow viewer gets only
the newest. Metres are east and north: of the start if the rover only knows what it dead-reckons, of the forest if
the run is simulated and so the truth is known.

A slow viewer does not delay another one or the rover. No viewer has a queue. All share one short list of news and the
newest state, and each viewer has a position in that list. It is sent what it lacks once it has acknowledged earlier
messages. So a viewer with a slow connection gets every piece of news but fewer states, and never an old state. One that
lacks more than the list holds gets everything again. One that acknowledges nothing is dropped.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple

import msgspec

from wayfarer.angles import wrap180
from wayfarer.control.rate import ASKED_AT_ONCE, ASKED_HZ
from wayfarer.fieldlog.clock import duration_text
from wayfarer.fieldlog.record import AnyRecord, Event, Header, Outcome, Tick, Truth
from wayfarer.fieldlog.run_fold import AnomalyBegan, PhaseChanged, RunBegan, RunFold, Told
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.logview.narrator import RunNarrator, Verbosity, further_texts, reason_text
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

    def add(self, record: AnyRecord) -> bool:
        """Add a record; return whether people should see it at once, not at the next regular moment."""
        run = self._fold.state
        was = run.mode, run.tick.held
        events = self._fold.add(record)
        for event in events:
            self._show(event)
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
        """Return how things are now.

        ``t_s`` is the time of the newest record of any kind, ``tick_t_s`` that of the newest tick, None before the
        first. What a tick says, such as the mode, may be older than ``t_s``.
        """
        run = self._fold.state
        tick, phase, level = run.tick, run.tick.phase, run.tick.level
        return {
            "t_s": round(run.t_s, 3),
            "tick_t_s": tick.t_s if run.ticks else None,  # exact: a page compares it with times of its replies
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
        """Return time and way, as all other views show them, and from when or by whom they are counted."""
        run = self._fold.state
        in_trial, knows_way = run.header.trial is not None, run.driven_m is not None
        return {
            "time_text": duration_text(run.elapsed_s if in_trial else run.mission_s),
            "time_of": "total" if in_trial else "mission",
            "way_m": run.driven_m if knows_way else round(run.mission_m, 2),
            "way_of": "driven" if knows_way else "commanded",
        }

    # -- what happened -------------------------------------------------------------------------------------------

    def _show(self, event: Told) -> None:
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

    def _tell(self, what: str, kept: deque[Any], piece: list[Any]) -> None:
        kept.append(piece)
        self._news.setdefault(what, []).append(piece)


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


class ViewerLimits(NamedTuple):
    """Bounds on what viewers use; seconds of the wall clock."""

    viewers: int = 16
    connections: int = 32  # viewers, and clients that are only being served the page
    handshake_s: float = 10.0  # from the connection to the end of the handshake
    message_bytes: int = 8_192
    news: int = 300  # half a minute at the full rate
    unseen: int = 3  # messages under way to one viewer
    old_s: float = 1.0  # what a page shows that is older must start no wheels; as OLD_S of the page
    requests: int = ASKED_AT_ONCE  # of one viewer, but for those that stop the wheels: each is written into the log
    requests_hz: float = ASKED_HZ
    silent_s: float = 10.0  # until a viewer that acknowledges nothing is dropped
    end_s: float = 0.3  # for the last messages: a run must end within 2 s


LIMITS = ViewerLimits()

Send = Callable[[str], Awaitable[None]]


class TooSlow(Exception):
    """A viewer has acknowledged nothing for too long."""


class Broadcaster:
    """News and states for all viewers; each is encoded once.

    Args:
        snapshot: returns everything that a new viewer needs; it may call ``tell``.
        limits: bounds on what viewers use.
    """

    def __init__(self, snapshot: Callable[[], Any], limits: ViewerLimits) -> None:
        self._snapshot = snapshot
        self._news: deque[str] = deque(maxlen=limits.news)
        self.viewers: set[PageViewer] = set()
        self.pieces = 0  # of news, so far
        self.states = 0
        self.state = ""

    def tell(self, news: dict[str, Any], state: dict[str, Any]) -> None:
        """Send to all viewers; ``news`` may be empty."""
        if news:
            self._news.append(_encoded(news=news))
            self.pieces += 1
        self.state = _encoded(state=state)
        self.states += 1
        for viewer in self.viewers:
            viewer.wake()

    def since(self, pieces: int | None) -> list[str]:
        """Return the news after the first ``pieces`` of it, or a snapshot if that is not possible."""
        if pieces is not None and self.pieces - pieces <= len(self._news):
            return list(self._news)[len(self._news) - (self.pieces - pieces) :]
        return [_encoded(snapshot=self._snapshot())]


class PageViewer:
    """One viewer, and how much it has been sent.

    Args:
        broadcaster: where news and states come from.
        send: sends it a text; waits while the connection is full.
        silent_s: how long it may acknowledge nothing, in seconds of the loop.
        unseen: how many messages may be under way.
    """

    def __init__(self, broadcaster: Broadcaster, send: Send, silent_s: float, unseen: int) -> None:
        self._broadcaster = broadcaster
        self._send = send
        self._silent_s = silent_s
        self._unseen = unseen
        self._awake = asyncio.Event()
        self._awake.set()
        self._heard = asyncio.Event()
        self._pieces: int | None = None
        self._states = 0
        self._sent = self._seen = 0

    def wake(self) -> None:
        """Check for something new."""
        self._awake.set()

    def acknowledge(self, seen: object) -> None:
        """Take the number of messages that the page says it has seen."""
        if isinstance(seen, int) and self._seen < seen <= self._sent:
            self._seen = seen
            self._since_s = asyncio.get_running_loop().time()
            self._heard.set()
            self.wake()

    async def catch_up(self) -> None:
        """Wait until everything is acknowledged."""
        while self._states != self._broadcaster.states or self._seen != self._sent:
            self._heard.clear()
            await self._heard.wait()

    async def follow(self) -> None:
        """Send what is new, until cancelled; raise ``TooSlow`` if it takes nothing, or acknowledges nothing."""
        time = asyncio.get_running_loop().time
        self._since_s = time()
        while True:
            await self._awake.wait()
            self._awake.clear()
            if self._sent == self._seen:
                self._since_s = time()
            elif time() - self._since_s > self._silent_s:
                raise TooSlow
            if self._sent - self._seen < self._unseen and self._states != self._broadcaster.states:
                await self._send_what_is_new()

    async def _send_what_is_new(self) -> None:
        broadcaster = self._broadcaster
        pieces = broadcaster.since(self._pieces)
        self._pieces, self._states = broadcaster.pieces, broadcaster.states
        self._sent += 1
        try:
            async with asyncio.timeout(self._silent_s):
                await self._send(f"[{','.join([*pieces, broadcaster.state])}]")
        except TimeoutError:
            raise TooSlow from None


def _encoded(**piece: Any) -> str:
    return msgspec.json.encode(piece).decode()
