"""The controller: arming, the control tick and the mission limits. Only it commands the wheels during a run.

A tick always has the same order::

    readings -> detector -> gate.update, which asks the escape handler -> motors -> log

Each stage fills in its part of one ``TickRecord``.

While the gate holds the wheels, the handler is not called and its clock is paused: when the hold ends, a manoeuvre with
a time limit continues where it was.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import partial
from math import inf, radians
from typing import Final

from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.latest import SensorBuffers
from wayfarer.control.power_reports import PowerReports
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick_record import TickRecord
from wayfarer.control.wheels import WheelMotors, Wheels
from wayfarer.detector import Detector
from wayfarer.escape.api import Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.recovery import Recovery
from wayfarer.hal import STOP, PositionFix, WheelCommand
from wayfarer.safety.arming import ArmingSequence
from wayfarer.safety.conditions import BLIND, MANUAL_LEVELS, UNCOMMANDED, Condition, Level
from wayfarer.safety.gate import Gate, ResumeWarning
from wayfarer.safety.manual import LEASE_S, ManualControl
from wayfarer.safety.mission_limits import Mission, RunEnd
from wayfarer.safety.permission import PERMISSION_S
from wayfarer.safety.tick_interval import IntervalTimer


class Mode(Enum):
    """Arming state of the rover; the wheels may turn only while it is ``ARMED``, or while a person drives."""

    DISARMED = "disarmed"
    ARMING = "arming"
    ARMED = "armed"
    MANUAL = "manual"


# Looking up a member of an Enum through its class is slow, and the tick does it 20 times a second.
_ARMED: Final = Mode.ARMED
_MANUAL: Final = Mode.MANUAL
_FAULT: Final = Level.FAULT
_RUNAWAY: Final = Condition.RUNAWAY
_MOTORS_FAILED: Final = Condition.MOTORS_FAILED
# Of what is driven without sight, this share counts for the distance from the start: the body drove, or pushed at a
# trunk, and nobody knows which.
UNSEEN_SHARE: Final = 0.5
# For so long ticks may find no memory; two that are further apart than the second have nothing to do with each other.
# Chosen by us.
LOST_TICKS_S: Final = 5.0
LOST_APART_S: Final = 60.0
BY_HAND: Final = Decision(STOP, Phase.MANUAL, Phase.MANUAL.value)


class Controller:
    """Runs the control tick and holds the mode.

    ``end`` is None until something ends the run; ``last`` is the record of the latest tick. ``power_reports`` takes the
    reports of the motor board and of the computer's supply; ``board`` is the monitor of the board's own reports.
    ``levels`` are the severities of this rover's conditions. ``cause_since_s`` is when the gate's present cause began,
    or the last one ended. ``manual`` is who drives by hand, if the mode says that somebody does. ``clock`` gives the
    time of now, on the clock of ``tick``. A mission's limit ends the run, or disarms the rover if it ``goes_on``.
    """

    def __init__(
        self,
        motors: WheelMotors,
        buffers: SensorBuffers,
        config: RoverConfig,
        detector: Detector,
        handler: EscapeHandler,
        log: RunLog,
        clock: Callable[[], float],
        *,
        goes_on: bool = False,
    ) -> None:
        self.power_reports = PowerReports(config.board, log)
        self.board = self.power_reports.board
        self.wheels = Wheels(motors, config.safety.tick_late_s, clock, log, self.power_reports.supply)
        self._buffers = buffers
        self._safety = config.safety
        self._late_s = config.safety.tick_late_s
        self._timer = IntervalTimer(config.safety.tick_late_s, config.vehicle.max_speed_m_s)
        self._detector = detector
        self._handler = handler
        self._log = log
        self._goes_on = goes_on
        self._gate = Gate(config.safety, config.control_hz)
        self.levels = self._gate.levels
        self._resume_warning = ResumeWarning(config.safety.resume_warning_s, self.levels)
        self._recovery = Recovery(config.progress)
        self.manual = ManualControl(config.manual)
        self._speed_m_s = config.manual.speed_m_s or config.escape.cruise_m_s
        self._turn_rad_s = radians(config.manual.turn_deg_s or config.escape.turn_deg_s)
        self._vehicle = config.vehicle
        self.mode = Mode.DISARMED
        self.end: RunEnd | None = None
        self.last: TickRecord | None = None
        self.why_disarmed = "not armed since the start"
        self.conditions: tuple[Condition, ...] = ()
        self.goal_heading_deg = 0.0
        self.mission: Mission | None = None
        self.held = False
        self._arming: ArmingSequence | None = None
        self._travelled_m = 0.0
        self._held_s = self._away_s = 0.0  # in which the gate held the wheels, and the algorithm did not have them
        self._carried = False
        self._lost_tick_s = self._lost_since_s = -inf
        self._applied = STOP
        self._driven = STOP  # what was applied, less what the slope takes up
        self._last_cause: Condition | None = None
        self.cause_since_s = 0.0

    # -- commands ------------------------------------------------------------------------------------------------

    def arm(self, t_s: float, goal_heading_deg: float | None) -> None:
        """Begin to arm: after the start delay the wheels may turn. See ``ArmingSequence`` for the goal heading.

        The motors must have been opened just before, which proves that they answer and that their deadman is on.
        """
        self.wheels.failed = self.held = False
        self._recovery.reset()
        self._detector.begin_arming()
        self.mission = None
        self._arming = ArmingSequence(self._safety, t_s, goal_heading_deg)
        self.mode = Mode.ARMING
        delay_s = self._safety.start_delay_s
        self._log.event("arming", t_s, start_delay_s=delay_s, goal_heading_deg=goal_heading_deg)

    def disarm(self, t_s: float, reason: str) -> None:
        """Stop the wheels from the next tick on, until re-armed; also if a person drives."""
        self._gate.levels = self.levels
        self.mode = Mode.DISARMED
        self.why_disarmed = reason
        self._arming = None
        self.mission = None
        self._log.event("disarmed", t_s, reason=reason)

    def begin_manual(self, t_s: float, lease: int, driver: str) -> None:
        """Let a client drive, see ``ManualControl.begin``; a mission waits, with the clock of its algorithm.

        The motors of a rover that was not armed must have been opened just before, as for ``arm``.
        """
        self.wheels.failed = self.held = False
        self._carried = True
        self._gate.levels = MANUAL_LEVELS
        self._gate.clear_fault()
        self.manual.begin(t_s, lease, driver)
        self.mode = _MANUAL
        self._log.event("manual", t_s, driver=driver)

    def end_manual(self, t_s: float, reason: str) -> None:
        """Stop the wheels: the rover is disarmed as before, or its mission is held until ``resume``."""
        self.mode = Mode.DISARMED if self.mission is None else _ARMED
        self.held = self.mission is not None
        self._carried = True
        self._gate.levels = self.levels
        self._log.event("manual_ended", t_s, reason=reason, mode=self.mode.value)

    def _forget_place(self) -> None:
        """Begin the algorithm again: a person has carried it to another place."""
        self._carried = False
        self._handler.reset()
        self._recovery.reset()
        self._resume_warning.reset()
        self._detector.begin_arming()

    def hold(self, t_s: float, *, held: bool) -> None:
        """Hold the wheels, or let them continue; the mission is not changed."""
        if held is not self.held:  # a repeated request changes nothing and is not logged
            self.held = held
            self._log.event("hold" if held else "resume", t_s)

    def set_goal(self, t_s: float, goal_heading_deg: float) -> None:
        """Change the goal of the mission, in degrees clockwise from magnetic north."""
        self.goal_heading_deg = goal_heading_deg
        self._log.event("goal", t_s, goal_heading_deg=goal_heading_deg)

    def position(self, fix: PositionFix | None) -> None:
        """Take a fix for the log and the mission's radius; no decision sees it."""
        self._log.position(fix)
        if fix is not None and self.mission is not None:
            self.mission.position(fix)

    def power(self, t_s: float, flags: int | None) -> None:
        """Take the power flags of the computer's firmware, None if there are none; see ``power.SupplyMonitor``."""
        self.power_reports.power(t_s, flags)

    @property
    def waits_for_motors(self) -> bool:
        """Whether a mission, or a person, waits until the motor board has been opened again."""
        return self.wheels.failed and (self.mode is _ARMED or self.mode is _MANUAL)

    def motors_opened(self, t_s: float) -> None:
        """Go on with a mission that waits: the motor board was opened again, and reports no fault."""
        if self.waits_for_motors:
            self.wheels.failed = False
            self._log.event("motors_opened", t_s)

    def finish(self, reason: str, text: str) -> None:
        """End the run; the first reason counts."""
        if self.end is None:
            self.end = RunEnd(reason, text)

    def lose_tick(self, t_s: float, error: MemoryError) -> None:
        """Stop the wheels after a tick for which no memory was left; a mission waits until the board was opened again.

        Its algorithm begins again then, because nobody knows how far the tick came.

        Raises:
            MemoryError: nobody waits for the wheels, or such ticks come for too long; the run must end.
        """
        self.wheels.halt()
        if t_s - self._lost_tick_s > LOST_APART_S:
            self._lost_since_s = t_s
        self._lost_tick_s = t_s
        if t_s - self._lost_since_s > LOST_TICKS_S or (self.mode is not _ARMED and self.mode is not _MANUAL):
            raise error
        self.wheels.lose(t_s, "no memory was left for a control tick", "tick")
        self._carried = True

    # -- the tick ------------------------------------------------------------------------------------------------

    async def tick(self, t_s: float) -> None:
        """Do one control tick at time ``t_s``."""
        if self.mode is _MANUAL and self.manual.is_silent(t_s):
            self.end_manual(t_s, f"nothing was heard of {self.manual.driver} for {LEASE_S:g} s")
        if self._carried:
            self._forget_place()
        tick, gate, mission = TickRecord(t_s, self._driven), self._gate, self.mission
        self._timer.measure(tick)
        self._buffers.read(tick)
        self._travelled_m += abs(tick.forward_m)
        self._detector.update(tick, armed=mission is not None)
        odometer = self._detector.odometer
        self._add_conditions(tick)
        conditions = self.conditions = tick.conditions
        if conditions and not UNCOMMANDED.isdisjoint(conditions):
            self.wheels.halt()  # at each tick: a board that does not obey may obey one of many stops
        if self._arming is not None:
            self._continue_arming(tick, self._arming)
        manual = self.mode is _MANUAL
        if mission is not None and (compass := self._detector.compass) is not None:
            ahead_m = odometer.ahead_m * (1.0 if BLIND.isdisjoint(conditions) else UNSEEN_SHARE)
            mission.advance(0.0 if manual else tick.forward_m, ahead_m, compass.heading_deg, odometer.right_m)
        observation = tick.observation = self._observe(tick)
        may_drive = manual or self.mode is _ARMED
        wanted = self._wanted_by_hand if manual else self._wanted_wheels
        wheels = gate.update(conditions, partial(wanted, tick), armed=may_drive)
        if manual:
            self._note_manual(tick)
        if gate.holds or manual:
            self._held_s += tick.dt_s
        tick.level, tick.cause, tick.memory = gate.level, gate.cause, self._handler.memory
        applied = await self.wheels.drive(t_s, wheels)  # meanwhile somebody may hold, disarm, or begin to drive
        self._applied = tick.applied = applied
        self._driven = self._detector.grade.level(applied)
        self.last = tick
        self._log.tick(tick)
        if tick.cause is not self._last_cause or (may_drive and tick.level is _FAULT):
            self._note_health(t_s, tick.level, tick.cause)
        if mission is not None and observation is not None:
            if manual:
                mission.wait(tick.dt_s)
            elif self.end is None and (limit := mission.end(t_s)) is not None:
                self._end_mission(t_s, limit)

    def _wanted_wheels(self, tick: TickRecord) -> WheelCommand:
        """Decide, once there has been a heading, and return the duties that are wanted."""
        if tick.observation is not None:
            tick.decision = self._decide(tick, tick.observation)
        return tick.decision.wheels

    def _wanted_by_hand(self, tick: TickRecord) -> WheelCommand:
        """Return the duties that the person wants who drives."""
        forward, turn = self.manual.wanted(tick.t_s)
        wheels = self._vehicle.mix(forward * self._speed_m_s, turn * self._turn_rad_s)
        tick.decision = BY_HAND._replace(wheels=wheels)
        return wheels

    def _note_manual(self, tick: TickRecord) -> None:
        """Note the sample of this tick; what the gate has stopped goes on only once the person has let go."""
        tick.manual = self.manual.sample
        if self._gate.holds:
            self.manual.must_let_go()
            tick.decision = BY_HAND

    def _decide(self, tick: TickRecord, observation: Observation) -> Decision:
        """Return the decision of the algorithm, or of what has taken the wheels from it; its clock stands then."""
        decision = self._recovery.decide(tick.t_s - self._held_s, observation)
        if decision is not None:
            self._away_s += tick.dt_s
            return decision
        decision = self._handler.decide(observation)
        wheels = self._detector.grade.compensate(decision.wheels)
        return decision if wheels is decision.wheels else decision._replace(wheels=wheels)

    def _add_conditions(self, tick: TickRecord) -> None:
        """Add the controller's own conditions to those of the detector."""
        armed, late = self.mode is _ARMED, tick.dt_s > self._late_s
        may_drive = armed or self.mode is _MANUAL
        mission = self.mission
        if mission is not None and armed:
            tick.conditions = self._recovery.judge(
                tick, tick.conditions, self._detector.moved, mission.north_m, mission.east_m,
                anomalous=bool(tick.anomalies),
            )  # fmt: skip
            if self._recovery.restarts:
                self._handler.reset()
        may_move = not may_drive or tick.t_s < self.wheels.unheard_until_s
        if tick.conditions and may_move and self._gate.cause is not _RUNAWAY:
            # A person may push a rover that is not armed; a rover that ran away is still stopped at each tick.
            tick.conditions = tuple(condition for condition in tick.conditions if condition is not _RUNAWAY)
        if late:
            tick.conditions += (Condition.TICK_LATE,)
        if self.power_reports.judge(self._applied):
            tick.conditions += self.power_reports.conditions(tick.t_s)
            if may_drive and _MOTORS_FAILED in tick.conditions:
                self.wheels.failed = True  # once the fault has gone, the board is opened again like a silent one
        if self.wheels.failed and _MOTORS_FAILED not in tick.conditions:
            tick.conditions += (_MOTORS_FAILED,)
        if self.held:
            tick.conditions += (Condition.OPERATOR_HOLD,)
        if armed and self._resume_warning.update(tick, tick.conditions):
            tick.conditions += (Condition.RESUME_WARNING,)

    def _observe(self, tick: TickRecord) -> Observation | None:
        """Return what the handler may see, or None before the first plausible heading."""
        compass = self._detector.compass
        if compass is None:
            return None
        _, heading_deg, pitch_deg, roll_deg, _ = compass
        return Observation(
            tick.t_s - self._held_s - self._away_s,
            heading_deg,
            pitch_deg,
            roll_deg,
            tick.anomalies,
            self._detector.contact,
            self.goal_heading_deg,
            self._travelled_m,
            self._detector.odometer.covered_m,
            tick.commanded,
        )

    def _continue_arming(self, tick: TickRecord, arming: ArmingSequence) -> None:
        t_s, compass = tick.t_s, self._detector.compass
        if tick.dt_s > PERMISSION_S:  # suspended meanwhile: who armed it expects nothing any more
            self.disarm(t_s, f"not armed: the daemon stood still for {tick.dt_s:.0f} s")
            return
        goal_heading_deg = arming.update(compass) if compass is not None else None
        stops = [condition.value for condition in tick.conditions if self.levels[condition] >= Level.DEGRADE]
        if goal_heading_deg is not None and not stops:
            self._detector.begin_mission(tick)
            self._begin_mission(t_s, goal_heading_deg)
        elif _MOTORS_FAILED in tick.conditions:  # arming has just opened the board, so that it must not fail now
            self.disarm(t_s, f"fault: {_MOTORS_FAILED.value}")
        elif arming.too_late(t_s):
            self.disarm(t_s, f"not armed: {', '.join(stops) or 'the heading did not settle'}")

    def _begin_mission(self, t_s: float, goal_heading_deg: float) -> None:
        self._arming = None
        self._gate.clear_fault()
        self._handler.reset()
        self._resume_warning.reset()
        self.goal_heading_deg = goal_heading_deg
        self.mission = Mission(self._safety, t_s)
        self.mode = Mode.ARMED
        self._log.event("armed", t_s, goal_heading_deg=goal_heading_deg)

    def _end_mission(self, t_s: float, limit: RunEnd) -> None:
        if not self._goes_on:
            self.end = limit
        elif self.mission is not None:  # else a fault has just disarmed it
            self.disarm(t_s, limit.reason)

    def _note_health(self, t_s: float, level: Level, cause: Condition | None) -> None:
        if cause is not self._last_cause:
            self._last_cause, self.cause_since_s = cause, t_s
        self._log.event("health", t_s, level=level.name.lower(), cause=cause.value if cause is not None else None)
        if level is Level.FAULT and self.mode is not Mode.DISARMED:
            self.disarm(t_s, f"fault: {cause.value if cause is not None else 'unknown'}")
