"""The one account of a run: takes its records in their order, and yields what happened and the state so far. Pure.

Nothing else compares a record with the one before it. Text, live page, Foxglove, reports and tables are renderings of
what comes out here. Records come from the reader, which has judged them, or from the log that writes them.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isnan

from wayfarer.escape.api import Phase
from wayfarer.escape.phases import PhaseEvent
from wayfarer.fieldlog.clock import seconds_since
from wayfarer.fieldlog.dead_reckoning import GAP_S, DeadReckoning
from wayfarer.fieldlog.fields import table
from wayfarer.fieldlog.missions import EpisodeTracker, MissionTracker
from wayfarer.fieldlog.run_events import (
    AnomalyBegan,
    BatteryChanged,
    BoardFaults,
    Ended,
    FaultInjected,
    Gap,
    Noted,
    PhaseChanged,
    PowerChanged,
    RunBegan,
    Silence,
)
from wayfarer.fieldlog.run_state import LowBattery, RunState
from wayfarer.fieldlog.schema import Record, fields_of
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.typed import Board, Computer, Fix, Header, RunEvent, Tick, Truth
from wayfarer.safety.conditions import Level

# Nobody reads a bumper that no decision uses: it has a status when it first speaks.
SENSORS = ("compass", "motion", "position")
HELD = {"hold", "fault"}  # the levels at which the gate lets no wheel turn
LIMITED = Level.DEGRADE.name.lower()
BACK_OFF = Phase.BACK_OFF.value
BATTERY_FALL_V = 0.1  # below the lowest told so far; a battery sags under load and comes back
BATTERY_RISE_V = 1.0  # another battery

Events = list[RunEvent]


class RunFold:
    """Takes the records of one run; ``state`` is the state after the last one.

    Args:
        reckons: work out by dead reckoning where the rover is. Lines of text need no places, and without them the
            fold takes a quarter less time.
    """

    def __init__(self, *, reckons: bool = True) -> None:
        self._reckons = reckons
        self.state = RunState()
        self._reckoning = DeadReckoning()
        self._number: int | None = None
        self._announced = 0
        self._unbroken = False
        self._episodes = EpisodeTracker()
        self._missions = MissionTracker(self.state)
        self._told_battery_v = float("inf")
        self._power_bits = ""
        self._takers: dict[str, Callable[[float, Record], Events]] = {
            "run": self._run, "tick": self._tick, "event": self._event, "position": self._position,
            "board": self._board, "computer": self._computer, "truth": self._truth, "fault": self._fault,
            "outcome": self._outcome,
        }  # fmt: skip

    def take(self, record: Record) -> Events:
        """Take the next record, and return what it tells: first what was read, then what changed."""
        state, t_s = self.state, record["t_s"]
        state.first, state.last = state.first or record, record
        state.elapsed_s = elapsed_s = seconds_since(state.first, record)
        state.lasted_s = max(state.lasted_s, elapsed_s)
        count, before = record.get("n"), self._number
        if count is None:
            return self._takers[record["record"]](elapsed_s, record)
        missing = 0 if before is None else count - before - 1
        gap = [self._gap(elapsed_s, t_s, missing)] if missing else []
        self._number, self._announced = count, 0
        return gap + self._takers[record["record"]](elapsed_s, record)

    def _gap(self, elapsed_s: float, t_s: float, missing: int) -> Gap:
        state = self.state
        state.stretch += 1
        state.missing += missing
        self._unbroken = False
        self._reckoning.interrupted()
        for sensor in state.sensors.values():
            sensor.interrupted()
        return Gap(elapsed_s, t_s, missing, announced=missing == self._announced)

    def _run(self, elapsed_s: float, record: Record) -> Events:
        state, header = self.state, Header.of(record)
        if state.header.record:
            return []  # a further part of the log says again what ran
        state.header = header
        self._reckoning.max_speed_m_s = header.setting("vehicle", "max_speed_m_s") or 0.0
        if (quality_min := header.setting("detector", "quality_min")) is not None:
            self._reckoning.quality_min = quality_min
        for sensor in SENSORS:
            if sensor in table(record, "parts"):
                self._sensor(sensor)
        late = header.part > 1
        if late and state.from_start is None:
            state.from_start = False  # the place of the next arming need not be the start
        return [RunBegan(elapsed_s, record["t_s"], header, late and self._number is None)]

    # -- ticks ---------------------------------------------------------------------------------------------------

    def _tick(self, elapsed_s: float, record: Record) -> Events:
        state, before = self.state, self.state.tick
        state.tick = tick = Tick.of(elapsed_s, record)
        state.ticks += 1
        tick.driven_m = state.driven_m
        for sensor in ("compass", "motion", "contact"):
            if (reading := record.get(sensor)) and self._sensor(sensor).take(reading):
                tick.fresh += (sensor,)
        if self._reckons:
            self._reckon(tick)
        self._count_time(tick, before)
        self._missions.take(tick)
        events: Events = [*self._silence(tick, before), tick]
        if tick.cause != before.cause:
            state.cause_since_s = elapsed_s
        if tick.phase != before.phase:
            state.recoveries += tick.phase == BACK_OFF
            events.append(PhaseChanged(elapsed_s, tick.t_s, tick.phase))
        if tick.anomalies != before.anomalies:
            new = sorted(set(tick.anomalies) - set(before.anomalies))
            state.anomalies.update(new)
            events += [AnomalyBegan(elapsed_s, tick.t_s, kind, tick.phase, tick.place) for kind in new]
        if tick.why != tick.phase:
            phase, _, event = (tick.why or "").partition(".")
            if event == PhaseEvent.EXHAUSTED.value:
                state.exhausted[phase] += 1
        begun = self._episodes.take(tick, before)
        state.episodes += len(begun)
        return events + begun

    def _silence(self, tick: Tick, before: Tick) -> Events:
        if not tick.t_s - before.t_s > GAP_S:  # nor is there one before the first tick, where it is NaN
            return []
        self.state.stretch += 1
        return [Silence(tick.elapsed_s, tick.t_s, before.elapsed_s)]

    def _reckon(self, tick: Tick) -> None:
        state, reckoning = self.state, self._reckoning
        duties = (tick.applied_left or 0.0) + (tick.applied_right or 0.0)
        motion = tick.motion
        tick.place = reckoning.take(tick.t_s, tick.heading_deg, duties, motion)
        tick.measured_m_s = reckoning.measured_m_s
        if motion is not None and (isnan(motion.forward_m) or not motion.quality >= reckoning.quality_min):
            self._sensor("motion").doubtful += 1
        tick.path_m = state.path_m = reckoning.path_m
        state.place = reckoning.place

    def _count_time(self, tick: Tick, before: Tick) -> None:
        state, passed_s = self.state, tick.t_s - before.t_s
        if self._unbroken:
            tick.period_s, tick.before = passed_s, before.place
        self._unbroken = True
        if state.mode == "armed" and passed_s > 0.0:
            state.armed_s += passed_s
            if tick.level in HELD:
                state.held_s[tick.cause or "unknown"] += passed_s
            elif tick.level == LIMITED:
                state.limited_s[tick.cause or "unknown"] += passed_s

    # -- events --------------------------------------------------------------------------------------------------

    def _event(self, elapsed_s: float, record: Record) -> Events:
        state, event = self.state, Noted.of(elapsed_s, record)
        state.events[event.name] += 1
        self._missions.note(event)
        match event:
            case Noted(name="armed" | "disarmed" | "manual"):
                self._episodes.end(event.name)
            case Noted(name="sensor_failed"):
                self._sensor(event.sensor).failures += 1
            case Noted(name="mark"):
                event.number = state.events["mark"]
            case Noted(name="log_gap"):
                self._announced += event.dropped
                state.dropped += event.dropped
        return [event]

    # -- everything else -----------------------------------------------------------------------------------------

    def _position(self, elapsed_s: float, record: Record) -> Events:
        self._sensor("position").take(record)
        where, before = fields_of(Fix, record), self.state.fix
        if not {"latitude_deg", "longitude_deg"} <= where.keys():
            return []
        fix = Fix(elapsed_s, record["t_s"], **where)
        if before is not None:
            fix.period_s = fix.t_s - before.t_s
        self.state.fix, self.state.first_fix = fix, self.state.first_fix or fix
        return [fix]

    def _board(self, elapsed_s: float, record: Record) -> Events:
        state, before = self.state, self.state.board
        board = Board(elapsed_s, record["t_s"], **fields_of(Board, record))
        board.period_s = board.t_s - before.t_s
        state.board = board
        events: Events = [board]
        if board.faults != before.faults:
            events.append(BoardFaults(elapsed_s, board.t_s, board.faults))
        battery_v, lowest = board.battery_v, state.low_battery
        if battery_v is None:
            return events
        if lowest is None or battery_v < lowest.battery_v:
            state.low_battery = LowBattery(battery_v, elapsed_s, state.tick.duty)
        if not -BATTERY_FALL_V < battery_v - self._told_battery_v < BATTERY_RISE_V:
            self._told_battery_v = battery_v
            events.append(BatteryChanged(elapsed_s, board.t_s, battery_v))
        return events

    def _computer(self, elapsed_s: float, record: Record) -> Events:
        computer = Computer(elapsed_s, record["t_s"], **fields_of(Computer, record))
        before, self._power_bits = self._power_bits, computer.power_bits
        if self._power_bits == before:
            return [computer]
        return [computer, PowerChanged(elapsed_s, computer.t_s, self._power_bits)]

    def _truth(self, elapsed_s: float, record: Record) -> Events:
        where = fields_of(Truth, record)
        self.state.driven_m = where.get("driven_m", self.state.driven_m)
        return [Truth(elapsed_s, record["t_s"], **where)] if {"x_m", "y_m"} <= where.keys() else []

    def _fault(self, elapsed_s: float, record: Record) -> Events:
        return [FaultInjected(elapsed_s, record["t_s"], **fields_of(FaultInjected, record))]

    def _outcome(self, elapsed_s: float, record: Record) -> Events:
        state = self.state
        state.ended = ended = Ended(elapsed_s, record["t_s"], **fields_of(Ended, record))
        state.mode, state.dropped = "ended", max(state.dropped, ended.dropped)
        return [ended]

    def _sensor(self, sensor: str) -> SensorStatus:
        status = self.state.sensors.get(sensor)
        if status is None:
            rate_hz = self.state.header.setting("rates", f"{sensor}_hz")
            stale_s = self.state.header.setting("detector", f"{sensor}_stale_s")
            status = self.state.sensors[sensor] = SensorStatus(rate_hz, stale_s)
        return status
