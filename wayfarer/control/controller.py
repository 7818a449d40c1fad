"""The controller: modes, the control tick and the mission limits. Only it decides what the wheels get during a run.

Pure: one record in, one record out, and nothing is waited for. A tick always has the same order::

    inputs -> detector -> gate.judge -> escape handler -> gate.limit -> wheels that the motors are to get

Each stage fills in its part of one ``TickRecord``. What people ask for comes between two ticks, by the methods of the
first part: they change the mode at once, as ``modes.MODES`` allows, and tell the caller whether they did. So a log that
has inputs and requests replays exactly. ``loop.ControlLoop`` is what waits: for the motors.

While the gate holds the wheels, the handler is not called and its clock is paused: when the hold ends, a manoeuvre with
a time limit continues where it was.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from math import inf, radians
from pathlib import Path
from random import Random
from typing import Any, Final

from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.modes import MAY_TURN, MODES, Entered, Event, Mode, Outcome, Refused, refusal
from wayfarer.control.run_log import SEVERITY, RunLog
from wayfarer.control.tick import Inputs, TickRecord
from wayfarer.detector import Detector
from wayfarer.errors import BadInput, one_line
from wayfarer.escape.api import Decision, EscapeHandler, Observation, Phase
from wayfarer.escape.recovery import Recovery
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import BLIND, MANUAL_LEVELS, UNCOMMANDED, Condition, Level
from wayfarer.safety.gate import Gate, ResumeWarning
from wayfarer.safety.manual import LEASE_S, ManualControl
from wayfarer.safety.mission import ArmingSequence, Mission, Place, RunEnd
from wayfarer.safety.permission import PERMISSION_S
from wayfarer.safety.power import MotorBoardMonitor, SupplyMonitor, meaning
from wayfarer.safety.tick_interval import IntervalTimer
from wayfarer.vocabulary import disarmed_text, goal_text, health_text

# Looking up a member of an Enum through its class is slow, and the tick does it 20 times per second.
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
LOST_APART_S: Final = 10.0
BY_HAND: Final = Decision(STOP, Phase.MANUAL, Phase.MANUAL.value)
# Made once: after a change of mode nothing may fail because there is no memory.
_ENTERED: Final = {mode: Entered(mode) for mode in Mode}
# A command that the board did not acknowledge may not have reached it. Its deadman stops the wheels after 0.3 s at most
# (as shipped); 0.5 s later motion has been seen to be over (fault catalogue, fault 30), by a camera 0.2 s after that.
UNHEARD_S: Final = 1.0


class Controller:
    """Decides each control tick and holds the mode.

    ``end`` is None until something ends the run; ``last`` is the record of the latest tick whose command was sent.
    ``board`` is the monitor of the motor board's reports. ``levels`` are the severities of this rover's conditions.
    ``cause_since_s`` is when the gate's present cause began, or the last one ended. ``manual`` is who drives by hand,
    if the mode says that somebody does. ``motors_failed`` is whether the motor board must be opened again before a
    wheel may turn, ``failures`` counts the commands that it did not acknowledge. ``ladder_seed`` is of the ladder's
    random turns. A mission's limit ends the run, or disarms the rover if it ``goes_on``.
    """

    def __init__(
        self, config: RoverConfig, detector: Detector, handler: EscapeHandler, log: RunLog,
        *, ladder_seed: int | str, goes_on: bool = False,
    ) -> None:  # fmt: skip
        self._safety = config.safety
        self._late_s = config.safety.tick_late_s
        self._timer = IntervalTimer(config.safety.tick_late_s, config.vehicle.max_speed_m_s)
        self._detector = detector
        self._handler = handler
        self._memory = handler.memory
        self._log = log
        self._goes_on = goes_on
        self._gate = Gate(config.safety, config.control_hz)
        self.levels = self._gate.levels
        self._resume_warning = ResumeWarning(config.safety.resume_warning_s, self.levels)
        self._recovery = Recovery(config.progress, Random(ladder_seed))
        self.manual = ManualControl(config.manual)
        self._speed_m_s = config.manual.speed_m_s or config.escape.cruise_m_s
        self._turn_rad_s = radians(config.manual.turn_deg_s or config.escape.turn_deg_s)
        self._vehicle = config.vehicle
        self.board = MotorBoardMonitor(config.board)
        self._supply = SupplyMonitor()
        # The commands of the last three ticks: the board may have been asked during any of them.
        self._latest_applied = (STOP, STOP, STOP)
        self.motors_failed = False
        self.failures = 0
        self._unheard_until_s = 0.0  # until then nobody knows what the wheels do
        self.mode = Mode.DISARMED
        self.end: RunEnd | None = None
        self.last: TickRecord | None = None
        self.why_disarmed = "not armed since the start"
        self.conditions: tuple[Condition, ...] = ()
        self.goal_heading_deg = 0.0
        self._place = Place()
        self.mission: Mission | None = None
        self.missions = 0
        self.held = False
        self._arming: ArmingSequence | None = None
        self._travelled_m = 0.0
        self._held_s = self._away_s = 0.0  # in which the gate held the wheels, and the algorithm did not have them
        self._begins_anew = False
        self._lost_tick_s = self._lost_since_s = -inf
        self._last_cause: Condition | None = None
        self.cause_since_s = 0.0

    # -- requests, between two ticks -----------------------------------------------------------------------------

    def why_not(self, event: Event) -> str:
        """Return why an event would be refused now, or an empty text."""
        return refusal(self.mode, event)

    def arm(self, t_s: float, goal_heading_deg: float | None) -> Outcome:
        """Begin to arm: after the start delay the wheels may turn. See ``ArmingSequence`` for the goal heading.

        The motors must have been opened just before, which proves that they answer and that their deadman is on.
        """
        if isinstance(outcome := self._enter(Event.ARM), Refused):
            return outcome
        self.motors_failed = False
        self._recovery.reset()
        self._detector.begin_arming()
        self._arming = ArmingSequence(self._safety, t_s, goal_heading_deg)
        delay_s = self._safety.start_delay_s
        after = f"in {delay_s:.0f} s " if delay_s else ""
        text = f"Arming: {after}it drives {goal_text(goal_heading_deg)}"
        self._log.logger.info("arming", t_s=t_s, text=text, start_delay_s=delay_s, goal_heading_deg=goal_heading_deg)
        return outcome

    def disarm(self, t_s: float, reason: str) -> Outcome:
        """Stop the wheels from the next tick on, until re-armed; also if a person drives. Never refused."""
        armed = self.mode is not Mode.DISARMED
        outcome = self._disarm(reason)
        if armed:  # logged afterwards: a log that fails must not prevent a stop
            self._log.logger.info("disarmed", t_s=t_s, text=f"Disarmed: {disarmed_text(reason)}", reason=reason)
        return outcome

    def _disarm(self, reason: str) -> Outcome:
        if self.mode is not Mode.DISARMED:
            self._gate.levels = self.levels
            self.why_disarmed = reason
            self._arming = None
            self.mission = None
            self.held = False  # a resume has nothing to continue any more
        return self._enter(Event.DISARM)

    def begin_manual(self, t_s: float, lease: int, driver: str) -> Outcome:
        """Let a client drive, see ``ManualControl.begin``; a mission waits, with the clock of its algorithm.

        The motors of a rover that was disarmed must have been opened just before, as for ``arm``. Those of a mission
        that waits for its board have not been: the person waits for it as well.
        """
        opened = self.mode is Mode.DISARMED
        if isinstance(outcome := self._enter(Event.MANUAL), Refused):
            return outcome
        self.motors_failed &= not opened
        self.held = False
        self._begins_anew = True
        self._gate.levels = MANUAL_LEVELS
        self._gate.clear_fault()
        self.manual.begin(t_s, lease, driver)
        how = "on the live page" if driver == "page" else f"with {driver}"
        self._log.logger.info("manual", t_s=t_s, text=f"A person drives {how}", driver=driver)
        return outcome

    def end_manual(self, t_s: float, reason: str) -> Outcome:
        """Stop the wheels: the rover is disarmed as before, or its mission is held until ``resume``."""
        if isinstance(outcome := self._enter(Event.END_MANUAL), Refused):
            return outcome
        self.held = self.mission is not None
        self._begins_anew = True
        self._gate.levels = self.levels
        mode = self.mode.value
        text = f"Nobody drives by hand any more; the rover is {mode}: {reason}"
        self._log.logger.info("manual_ended", t_s=t_s, text=text, reason=reason, mode=mode)
        return outcome

    def hold(self, t_s: float) -> Outcome:
        """Hold the wheels until ``resume``; the mission is not changed. Nobody drives by hand any more."""
        if self.mode is _MANUAL:
            return self.end_manual(t_s, "asked to hold")
        outcome = self._enter(Event.HOLD)
        if isinstance(outcome, Entered) and not self.held:  # a repeated request is not logged
            self.held = True
            self._log.logger.info("hold", t_s=t_s, text="Held by an operator")
        return outcome

    def resume(self, t_s: float) -> Outcome:
        """Let the wheels continue."""
        outcome = self._enter(Event.RESUME)
        if isinstance(outcome, Entered) and self.held:
            self.held = False
            self._log.logger.info("resume", t_s=t_s, text="Resumed by an operator")
        return outcome

    def set_goal(self, t_s: float, goal_heading_deg: float) -> Outcome:
        """Change the goal of the mission, in degrees clockwise from magnetic north."""
        if isinstance(outcome := self._enter(Event.GOAL), Entered):
            self.goal_heading_deg = goal_heading_deg
            text = f"A new goal: drives {goal_text(goal_heading_deg)}"
            self._log.logger.info("goal", t_s=t_s, text=text, goal_heading_deg=goal_heading_deg)
        return outcome

    def _enter(self, event: Event) -> Outcome:
        """Take the step of the table for this event, or refuse it."""
        row = MODES.get((self.mode, event))
        if row is None:
            return Refused(refusal(self.mode, event))
        if row.to is not None:
            self.mode = row.to
        else:  # what was before a person drove
            self.mode = Mode.DISARMED if self.mission is None else _ARMED
        return _ENTERED[self.mode]

    @property
    def may_turn(self) -> bool:
        """Whether the mode lets the wheels turn, and nobody holds them."""
        return (self.mode is _ARMED or self.mode is _MANUAL) and not self.held

    @property
    def waits_for_motors(self) -> bool:
        """Whether a mission, or a person, waits until the motor board has been opened again."""
        return self.motors_failed and self.mode in MAY_TURN

    def motors_opened(self, t_s: float) -> Outcome:
        """Go on with a mission that waits: the motor board was opened again, and reports no fault."""
        outcome = self._enter(Event.BOARD_OPENED)
        if isinstance(outcome, Entered) and self.motors_failed:
            self.motors_failed = False
            text = "The motor board was opened again: it answers, and its deadman is on"
            self._log.logger.info("motors_opened", t_s=t_s, text=text)
        return outcome

    def motors_lost(self, t_s: float, error: str, lost: str | None = None) -> None:
        """Hold the wheels until the board was opened again: it did not acknowledge the command of the tick at ``t_s``.

        Without an acknowledgement the state of the wheels is unknown. The board's deadman stops them. ``lost`` is
        ``power`` if the board lost its power, ``tick`` if the tick did not end.
        """
        self.failures += 1
        first, self.motors_failed = not self.motors_failed, True
        if first:
            self._unheard_until_s = t_s + UNHEARD_S
            if lost == "power":
                self._supply.dip(t_s)
        if first or t_s == self._lost_since_s:  # a log can be replayed up to the first tick that did not end
            text = f"The motors did not answer: {error}"
            self._log.logger.error("motors_failed", t_s=t_s, text=text, error=error, lost=lost)

    def finish(self, reason: str, text: str) -> None:
        """End the run; the first reason counts."""
        if self.end is None:
            self.end = RunEnd(reason, text)

    def lose_tick(self, t_s: float, error: MemoryError) -> None:
        """Take a tick for which no memory was left; a mission waits until the board was opened again.

        Its algorithm begins again then, because nobody knows how far the tick came.

        Raises:
            MemoryError: nobody waits for the wheels, the mission has not begun, or such ticks come for too long; the
                run must end.
        """
        if t_s - self._lost_tick_s > LOST_APART_S:
            self._lost_since_s = t_s
        self._lost_tick_s = t_s
        if t_s - self._lost_since_s > LOST_TICKS_S or (self.mission is None and self.mode is not _MANUAL):
            raise error
        self._begins_anew = True
        with suppress(MemoryError):  # for its event: the wheels are held already
            self.motors_lost(t_s, "no memory was left for a control tick", "tick")

    # -- the tick ------------------------------------------------------------------------------------------------

    def step(self, inputs: Inputs) -> TickRecord:
        """Decide one control tick; the caller sends ``wheels`` of the record to the motors."""
        t_s = inputs.t_s
        if self.mode is _MANUAL and self.manual.is_silent(t_s):
            self.end_manual(t_s, f"nothing was heard from {self.manual.driver} for {LEASE_S:g} s")
        if self._begins_anew:
            self._forget_place()
        # What the wheels were given, less what the slope takes up, is what moves the body.
        driven, gate, mission = self._detector.grade.on_flat_ground(inputs.applied), self._gate, self.mission
        tick = TickRecord(t_s, driven)
        tick.compass, tick.motion, tick.contact = inputs.compass, inputs.motion, inputs.contact
        tick.rims, tick.duties = inputs.wheels, inputs.applied
        self._timer.measure(tick)
        self._travelled_m += abs(tick.forward_m)
        self._detector.update(tick, armed=mission is not None)
        odometer = self._detector.odometer
        self._hear(inputs)
        self._add_conditions(tick)
        conditions = self.conditions = tick.conditions
        tick.halts = bool(conditions) and not UNCOMMANDED.isdisjoint(conditions)
        if self._arming is not None:
            self._continue_arming(tick, self._arming)
        manual = self.mode is _MANUAL
        place = self._place
        if (compass := self._detector.compass) is not None:
            ahead_m = odometer.ahead_m * (1.0 if not conditions or BLIND.isdisjoint(conditions) else UNSEEN_SHARE)
            place.move(ahead_m, odometer.right_m, compass.heading_deg)
            if mission is not None:
                mission.advance(0.0 if manual else tick.forward_m)
        observation = tick.observation = self._observe(tick)
        may_drive = manual or self.mode is _ARMED
        if gate.judge(conditions, armed=may_drive):
            tick.wheels = gate.limit(self._wanted_by_hand(tick) if manual else self._decide(tick))
        if manual:
            self._note_manual(tick)
        if gate.holds or manual:
            self._held_s += tick.dt_s
        tick.level, tick.cause, tick.memory = gate.level, gate.cause, self._memory
        self._tell_where(tick)
        if tick.cause is not self._last_cause or (may_drive and tick.level is _FAULT):
            self._note_health(tick)
        if mission is not None and observation is not None:
            if manual:
                mission.wait(tick.dt_s)
            elif self.end is None and (limit := mission.end(t_s)) is not None:
                self._end_mission(tick, limit)
        return tick

    def _tell_where(self, tick: TickRecord) -> None:
        """Fill in what the rover knows of itself, for the log; no decision comes from it."""
        tick.mode, tick.held = self.mode, self.held
        place, mission = self._place, self.mission
        tick.path_m = place.path_m
        if place.known:
            tick.north_m, tick.east_m = place.north_m, place.east_m
        if mission is not None:
            tick.mission_s, tick.mission_m = tick.t_s - mission.starts_s, mission.travelled_m
            tick.goal_heading_deg = self.goal_heading_deg

    def _forget_place(self) -> None:
        """Begin the algorithm again: a person has carried the rover to another place."""
        self._begins_anew = False
        self._handler.reset()
        self._recovery.reset()
        self._resume_warning.reset()
        self._detector.begin_arming()

    def _wanted_by_hand(self, tick: TickRecord) -> WheelCommand:
        """Return the duties that the person wants who drives."""
        forward, turn = self.manual.wanted(tick.t_s)
        wheels = self._vehicle.mix(forward * self._speed_m_s, turn * self._turn_rad_s)
        tick.decision = Decision(wheels, Phase.MANUAL, Phase.MANUAL.value)
        return wheels

    def _note_manual(self, tick: TickRecord) -> None:
        """Note the sample of this tick; what the gate has stopped goes on only once the person has let go."""
        tick.manual = self.manual.sample
        if self._gate.holds:
            self.manual.must_let_go()
            tick.decision = BY_HAND

    def _decide(self, tick: TickRecord) -> WheelCommand:
        """Return the duties that the algorithm wants, or what has taken the wheels from it; its clock stands then."""
        observation = tick.observation
        if observation is None:
            return STOP
        decision = self._recovery.decide(tick.t_s - self._held_s, observation)
        if decision is not None:
            self._away_s += tick.dt_s
        else:
            handler: Any = self._handler  # somebody's own may return anything
            decided: object = handler.decide(observation)
            if not isinstance(decided, Decision):
                raise _no_decision(handler, decided)
            decision = decided
            wheels = self._detector.grade.compensate(decision.wheels)
            if wheels is not decision.wheels:
                decision = Decision(wheels, decision.phase, decision.why)
        tick.decision = decision
        return decision.wheels

    def _hear(self, inputs: Inputs) -> None:
        """Take what receiver, motor board and the computer's supply have said since the tick before."""
        _, before, last = self._latest_applied
        self._latest_applied = before, last, inputs.applied
        for fix in inputs.fixes:
            self._log.position(fix)
            if fix is not None and self.mission is not None:
                self.mission.position(fix)
        for report in inputs.board:
            if report.health is not None:
                self.board.update(report.t_s, report.health, report.duties, self._latest_applied)
                self._log.board(report.t_s, report.health, report.duties)
                continue
            if Condition.BOARD_SILENT not in self.board.conditions:
                text = f"The motor board did not answer: {report.error}"
                self._log.logger.warning("board_silent", t_s=report.t_s, text=text, error=report.error)
            self.board.silent()
        for t_s, flags in inputs.power:
            now = flags or 0
            if now != (self._supply.flags or 0):  # the log has only this, so a replay gets the same
                text = f"The computer's supply: {meaning(now)}"
                self._log.logger.warning("power", t_s=t_s, text=text, flags=f"{now:#x}")
                self._supply.update(t_s, flags)

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
        may_move = not may_drive or tick.t_s < self._unheard_until_s
        if tick.conditions and may_move and self._gate.cause is not _RUNAWAY:
            # A person may push a rover that is not armed; a rover that ran away is still stopped at each tick.
            tick.conditions = tuple(condition for condition in tick.conditions if condition is not _RUNAWAY)
        if late:
            tick.conditions += (Condition.TICK_LATE,)
        if self.board.conditions or self._supply.noticed:
            tick.conditions += self.board.conditions + self._supply.conditions(tick.t_s)
            if may_drive and _MOTORS_FAILED in tick.conditions:
                self.motors_failed = True  # once the fault has gone, the board is opened again like a silent one
        if self.motors_failed and _MOTORS_FAILED not in tick.conditions:
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
        return Observation(
            tick.t_s - self._held_s - self._away_s,
            compass.heading_deg,
            compass.pitch_deg,
            compass.roll_deg,
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
            self._conclude_disarmed(tick, f"not armed: the daemon was suspended for {tick.dt_s:.0f} s")
            return
        goal_heading_deg = arming.update(compass) if compass is not None else None
        stops = [condition.value for condition in tick.conditions if self.levels[condition] >= Level.DEGRADE]
        if goal_heading_deg is not None and not stops and isinstance(self._enter(Event.SETTLED), Entered):
            self._detector.begin_mission(tick)
            self._begin_mission(t_s, goal_heading_deg)
        elif _MOTORS_FAILED in tick.conditions:  # arming has just opened the board, so that it must not fail now
            self._conclude_disarmed(tick, f"fault: {_MOTORS_FAILED.value}")
        elif arming.too_late(t_s):
            self._conclude_disarmed(tick, f"not armed: {', '.join(stops) or 'the heading did not settle'}")

    def _begin_mission(self, t_s: float, goal_heading_deg: float) -> None:
        self._arming = None
        self._gate.clear_fault()
        self._handler.reset()
        self._resume_warning.reset()
        self.goal_heading_deg = goal_heading_deg
        self.mission = Mission(self._safety, t_s, self._place)  # the last of it, see ``lose_tick``
        self.missions += 1
        self._log.bind(mission=self.missions)
        text = f"Armed: drives {goal_text(goal_heading_deg)}"
        self._log.logger.info("armed", t_s=t_s, text=text, goal_heading_deg=goal_heading_deg)

    def _end_mission(self, tick: TickRecord, limit: RunEnd) -> None:
        if not self._goes_on:
            self.end = limit
        elif self.mission is not None:  # else a fault has just disarmed it
            self._conclude_disarmed(tick, limit.reason)

    def _note_health(self, tick: TickRecord) -> None:
        level, cause = tick.level, tick.cause
        if cause is not self._last_cause:
            self._last_cause, self.cause_since_s = cause, tick.t_s
        name, why = level.name.lower(), cause.value if cause is not None else None
        tick.conclude(SEVERITY[name], "health", text=health_text(name, why), level=name, cause=why)
        if level is Level.FAULT and self.mode is not Mode.DISARMED:
            self._conclude_disarmed(tick, f"fault: {cause.value if cause is not None else 'unknown'}")

    def _conclude_disarmed(self, tick: TickRecord, reason: str) -> None:
        """Disarm because of what this tick has seen: the log has it after the tick's own record."""
        self._disarm(reason)
        tick.wheels = STOP  # a limit is judged after the decision
        tick.conclude("info", "disarmed", text=f"Disarmed: {disarmed_text(reason)}", reason=reason)


def _no_decision(handler: object, decided: object) -> BadInput:
    own = type(handler)
    file = Path(getattr(sys.modules.get(own.__module__), "__file__", None) or own.__name__).name
    return BadInput(one_line(f"decide() of {file} returned {repr(decided)[:80]}, not a Decision"))
