"""The one account of a run: takes its records in their order, and yields what changed, and the state so far. Pure.

Nothing else compares a record with the one before it. Text, live page, Foxglove, reports and tables are renderings of
what comes out here: the records themselves, and the changes below. Records come from the reader, which has judged
them, or from the log that writes them.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from math import nan

from wayfarer.escape.api import Phase
from wayfarer.escape.phases import PhaseEvent
from wayfarer.fieldlog.record import (
    SCHEMA,
    AnyRecord,
    Board,
    Computer,
    Event,
    Fix,
    Header,
    Outcome,
    ReckonedPose,
    Tick,
    Truth,
)
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.safety.conditions import Level

GAP_S = 1.0  # no tick is that late: the loop was held up, or records are missing
# Nobody reads a bumper that no decision uses: it has a status when it first speaks.
SENSORS = ("compass", "motion", "wheels", "position")
HELD = {"hold", "fault"}  # the levels at which the gate lets no wheel turn
LIMITED = Level.DEGRADE.name.lower()
BACK_OFF, FOLLOW, TURN_AWAY = Phase.BACK_OFF.value, Phase.FOLLOW.value, Phase.TURN_AWAY.value
MANOEUVRES = {phase.value for phase in Phase} - {FOLLOW, Phase.HALT.value, Phase.MANUAL.value}
RECOVERY = "ladder."  # its decisions take the wheels from the algorithm: its drives are in no episode
SIDES = {1.0: "right", -1.0: "left"}  # tau: clockwise is to the right
BATTERY_FALL_V = 0.1  # below the lowest reported so far; a battery sags under load and comes back
BATTERY_RISE_V = 1.0  # another battery


# -- what changes from one record to the next --------------------------------------------------------------------------


@dataclass(slots=True)
class Change:
    """A change, with the times of the record that shows it."""

    elapsed_s: float
    t_s: float


@dataclass(slots=True)
class RunBegan(Change):
    """The log says what ran. ``late``: its first parts are gone, and no record came before this one."""

    header: Header
    late: bool


@dataclass(slots=True)
class Gap(Change):
    """So many records are missing before this time."""

    missing: int


@dataclass(slots=True)
class Silence(Change):
    """No control tick for longer than ``GAP_S``: from ``began_s``, elapsed seconds as well, until this one."""

    began_s: float

    @property
    def text(self) -> str:
        """Say for how long."""
        return f"no ticks for {self.elapsed_s - self.began_s:.1f} s"


@dataclass(slots=True)
class PhaseChanged(Change):
    """The rover does something else now; the tick says why."""

    phase: str


@dataclass(slots=True)
class AnomalyBegan(Change):
    """An anomaly that was not there in the tick before; ``place`` is where dead reckoning had the rover."""

    kind: str
    phase: str
    place: ReckonedPose | None


@dataclass(slots=True)
class BoardFaults(Change):
    """The motor board reports other faults than before; none: it is well again."""

    faults: tuple[str, ...]


@dataclass(slots=True)
class BatteryChanged(Change):
    """The battery's voltage is lower than any reported so far, or the battery was changed."""

    battery_v: float


@dataclass(slots=True)
class PowerChanged(Change):
    """The computer's power and heat bits changed; empty: it is well again."""

    bits: str


@dataclass(slots=True)
class Episode:
    """From the first manoeuvre until the goal is followed again. A hold interrupts it; re-arming ends it.

    ``side`` is that of the first turn, empty if it is not known; ``metres`` by dead reckoning. ``ended_by`` is the
    ``why`` of the tick that ended it, or the event; None if it goes on or was cut off.
    """

    start_s: float
    side: str
    end_s: float
    from_m: float
    metres: float = 0.0
    turns: int = 0
    ended_by: str | None = None


@dataclass(slots=True)
class EpisodeBegan(Change):
    """An episode; the fold continues to write in it until it ends."""

    episode: Episode


Told = AnyRecord | Change


# -- the state so far --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LowBattery:
    """The lowest voltage, seconds since the run began, and the larger duty of the two sides then."""

    battery_v: float
    at_s: float
    duty: float


NO_TICK = Tick(
    t_s=nan, elapsed_s=nan, t_wall=0.0, phase="", why="", wanted_left=None, wanted_right=None, applied_left=None,
    applied_right=None,
)  # fmt: skip
NO_HEADER = Header(schema=SCHEMA, t_s=nan, t_wall=0.0)


@dataclass(slots=True)
class RunState:
    """The state of a run. Bounded: it does not grow with the log.

    ``last`` is the newest record, ``elapsed_s`` its time, and ``lasted_s`` the latest of all: a position is a little
    older than the record before it. Before the first header or tick, those are records without values. ``period_s`` is
    the time between the last two ticks, NaN if records are missing between them; ``measured_m_s`` the speed by the last
    reading of the motion sensor that is evidence, NaN after ``GAP_S``.

    ``place`` is the latest by dead reckoning, and ``start`` where the rover was first armed, if that is in the log
    (``from_start``; None: it was not armed yet). ``driven_m`` is the true way of a simulated rover, None of any other.
    ``mission_s`` and ``mission_m`` are those of the last mission.

    ``armed_s`` is the time armed, ``held_s`` the part of it with the wheels held, by cause, ``limited_s`` that of
    driving with limits (level ``degrade``). ``cause_since_s`` is when the present cause began. ``anomalies`` counts
    beginnings by kind, ``recoveries`` how often the rover backed off, ``exhausted`` the phases that reached their
    bound, ``events`` the events by name. ``episodes`` counts those of all missions. ``stretch`` grows whenever the log
    breaks off: records are missing, or there is no tick for a while. ``missing`` are the records missing so far.
    """

    header: Header = NO_HEADER
    last: AnyRecord | None = None
    elapsed_s: float = 0.0
    lasted_s: float = 0.0
    why_disarmed: str = "not armed since the start"
    tick: Tick = NO_TICK
    board: Board | None = None
    fix: Fix | None = None
    first_fix: Fix | None = None
    ended: Outcome | None = None
    place: ReckonedPose | None = None
    start: ReckonedPose | None = None
    from_start: bool | None = None
    driven_m: float | None = None
    mission_s: float = 0.0
    mission_m: float = 0.0
    period_s: float = nan
    measured_m_s: float = nan
    armed_s: float = 0.0
    held_s: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    limited_s: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    cause_since_s: float = 0.0
    ticks: int = 0
    anomalies: Counter[str] = field(default_factory=Counter)
    episodes: int = 0
    recoveries: int = 0
    exhausted: Counter[str] = field(default_factory=Counter)
    events: Counter[str] = field(default_factory=Counter)
    low_battery: LowBattery | None = None
    sensors: dict[str, SensorStatus] = field(default_factory=dict)
    stretch: int = 0
    missing: int = 0
    dropped: int = 0

    @property
    def mode(self) -> str:
        """``disarmed``, ``arming``, ``armed``, ``manual`` or ``ended``."""
        return self.tick.mode if self.ended is None else "ended"

    @property
    def t_s(self) -> float:
        """The loop's clock at the newest record."""
        return 0.0 if self.last is None else self.last.t_s


class RunFold:
    """Takes the records of one run; ``state`` is the state after the last one."""

    def __init__(self) -> None:
        self.state = RunState()
        self._number = 0
        self._unbroken = False
        self._episode: Episode | None = None
        self._told_battery_v = float("inf")
        self._power_bits = ""
        self._read_t_s = nan  # of the last reading of the motion sensor
        self._measured_t_s = nan

    def add(self, record: AnyRecord) -> list[Told]:
        """Take the next record, and return what it says: first what was read, then what changed."""
        state = self.state
        state.last = record
        state.elapsed_s = record.elapsed_s
        state.lasted_s = max(state.lasted_s, record.elapsed_s)
        told: list[Told] = []
        if record.n:
            missing = record.n - self._number - 1 if self._number else 0
            if missing:
                told.append(self._gap(record, missing))
            self._number = record.n
        match record:
            case Tick():
                told += self._tick(record)
            case Header():
                told += self._header(record)
            case Event():
                told += self._event(record)
            case Fix():
                told += self._fix(record)
            case Board():
                told += self._board(record)
            case Computer():
                told += self._computer(record)
            case Truth():
                state.driven_m = record.driven_m
                told.append(record)
            case Outcome():
                state.ended = record
                state.dropped = max(state.dropped, record.dropped)
                told.append(record)
            case _:
                told.append(record)
        return told

    def _gap(self, record: AnyRecord, missing: int) -> Gap:
        state = self.state
        state.stretch += 1
        state.missing += missing
        self._unbroken = False
        self._read_t_s = state.measured_m_s = nan
        for sensor in state.sensors.values():
            sensor.interrupted()
        return Gap(record.elapsed_s, record.t_s, missing)

    def _header(self, header: Header) -> list[Told]:
        state = self.state
        if state.header is not NO_HEADER:
            return []  # a further part of the log says again what ran
        state.header = header
        for sensor in SENSORS:
            if sensor in header.parts:
                self._sensor(sensor)
        late = header.part > 1
        if late and state.from_start is None:
            state.from_start = False  # the place of the next arming need not be the start
        return [RunBegan(header.elapsed_s, header.t_s, header, late and not self._number)]

    # -- ticks ---------------------------------------------------------------------------------------------------

    def _tick(self, tick: Tick) -> list[Told]:
        state, before = self.state, self.state.tick
        state.tick = tick
        state.ticks += 1
        for name in ("compass", "motion", "contact", "wheels"):
            if (reading := getattr(tick, name)) is not None:
                self._sensor(name).add(reading)
        self._place(tick)
        passed_s = tick.t_s - before.t_s
        state.period_s = passed_s if self._unbroken else nan
        self._unbroken = True
        if before.mode == "armed" and passed_s > 0.0:
            state.armed_s += passed_s
            if before.level in HELD:
                state.held_s[before.cause or "unknown"] += passed_s
            elif before.level == LIMITED:
                state.limited_s[before.cause or "unknown"] += passed_s
        told: list[Told] = []
        if passed_s > GAP_S:  # NaN before the first tick
            state.stretch += 1
            told.append(Silence(tick.elapsed_s, tick.t_s, before.elapsed_s))
        told.append(tick)
        if tick.cause != before.cause:
            state.cause_since_s = tick.elapsed_s
        if tick.phase != before.phase:
            state.recoveries += tick.phase == BACK_OFF
            told.append(PhaseChanged(tick.elapsed_s, tick.t_s, tick.phase))
        if tick.anomalies != before.anomalies:
            new = sorted(set(tick.anomalies) - set(before.anomalies))
            state.anomalies.update(new)
            told += [AnomalyBegan(tick.elapsed_s, tick.t_s, kind, tick.phase, tick.place) for kind in new]
        if tick.why != tick.phase:
            phase, _, event = tick.why.partition(".")
            if event == PhaseEvent.EXHAUSTED.value:
                state.exhausted[phase] += 1
        return told + self._follow_episode(tick, before)

    def _place(self, tick: Tick) -> None:
        """Take where the rover is, and how fast its motion sensor saw it go."""
        state, motion = self.state, tick.motion
        if tick.place is not None:
            state.place = tick.place
        if tick.mission_s is not None and tick.mission_m is not None:
            state.mission_s, state.mission_m = tick.mission_s, tick.mission_m
            if state.from_start is None:
                state.from_start = tick.mission_s < GAP_S  # else the mission began in what is lost
                state.start = state.place if state.from_start else None
        if not tick.t_s - self._measured_t_s <= GAP_S:
            state.measured_m_s = nan
        if motion is None or motion.t_s is None:
            return
        since_s, self._read_t_s = motion.t_s - self._read_t_s, motion.t_s
        quality_min = state.header.setting("detector", "quality_min") or 0.0
        if motion.forward_m is None or not (motion.quality or 0.0) >= quality_min:
            self._sensor("motion").doubtful += 1
        elif 0.0 < since_s < GAP_S:
            back = not motion.signed and (tick.applied_left or 0.0) + (tick.applied_right or 0.0) < 0.0
            state.measured_m_s = (-motion.forward_m if back else motion.forward_m) / since_s
            self._measured_t_s = tick.t_s

    def _follow_episode(self, tick: Tick, before: Tick) -> list[Told]:
        """Begin, continue with or end an episode."""
        episode, phase = self._episode, tick.phase
        told: list[Told] = []
        if episode is None:
            if phase not in MANOEUVRES or tick.why.startswith(RECOVERY):
                return told
            side = SIDES.get(tick.remembered("side") or 0.0, "")
            episode = self._episode = Episode(tick.elapsed_s, side, tick.elapsed_s, tick.path_m)
            self.state.episodes += 1
            told.append(EpisodeBegan(tick.elapsed_s, tick.t_s, episode))
        episode.metres = tick.path_m - episode.from_m
        episode.turns += phase == TURN_AWAY != before.phase
        if phase in MANOEUVRES or phase == FOLLOW:
            episode.end_s = tick.elapsed_s
        if phase == FOLLOW:
            self._end_episode(tick.why)
        return told

    def _end_episode(self, why: str) -> None:
        if self._episode is not None:
            self._episode.ended_by, self._episode = why, None

    # -- everything else -----------------------------------------------------------------------------------------

    def _event(self, event: Event) -> list[Told]:
        state = self.state
        state.events[event.name] += 1
        if event.name in {"armed", "disarmed", "manual"}:
            self._end_episode(event.name)
        if event.name == "disarmed":
            state.why_disarmed = event.word("reason") or ""
        elif event.name == "sensor_failed":
            self._sensor(event.word("sensor") or "unknown").failures += 1
        return [event]

    def _fix(self, fix: Fix) -> list[Told]:
        self._sensor("position").add(fix)
        self.state.fix, self.state.first_fix = fix, self.state.first_fix or fix
        return [fix]

    def _board(self, board: Board) -> list[Told]:
        state, before = self.state, self.state.board
        state.board = board
        told: list[Told] = [board]
        if board.faults != (before.faults if before is not None else ()):
            told.append(BoardFaults(board.elapsed_s, board.t_s, board.faults))
        battery_v, lowest = board.battery_v, state.low_battery
        if battery_v is None:
            return told
        if lowest is None or battery_v < lowest.battery_v:
            state.low_battery = LowBattery(battery_v, board.elapsed_s, state.tick.duty)
        if not -BATTERY_FALL_V < battery_v - self._told_battery_v < BATTERY_RISE_V:
            self._told_battery_v = battery_v
            told.append(BatteryChanged(board.elapsed_s, board.t_s, battery_v))
        return told

    def _computer(self, computer: Computer) -> list[Told]:
        before, self._power_bits = self._power_bits, computer.power_bits
        self.state.dropped = max(self.state.dropped, computer.log_dropped or 0)
        if self._power_bits == before:
            return [computer]
        return [computer, PowerChanged(computer.elapsed_s, computer.t_s, self._power_bits)]

    def _sensor(self, sensor: str) -> SensorStatus:
        status = self.state.sensors.get(sensor)
        if status is None:
            header = self.state.header
            rate_hz, stale_s = header.setting("rates", f"{sensor}_hz"), header.setting("detector", f"{sensor}_stale_s")
            status = self.state.sensors[sensor] = SensorStatus(rate_hz, stale_s)
        return status
