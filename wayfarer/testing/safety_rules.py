"""The safety rules of every run, monitored from outside the field code at each tick and world step.

1. Nothing commands motion while the rover is not armed, unless a person drives it, and nothing arms it but a person.
   Driven by hand, it moves only as long as the newest sample of what the person wants is younger than the deadman.
2. From the tick on at which a hold or a fault is concluded, or somebody disarms, nothing commands motion, and the
   wheels are stopped within the bound. After a command that the motor board did not acknowledge, nothing commands
   motion before the board was opened again and the warning is over.
3. A fault stays until the rover is re-armed, or a person drives it.
4. No decision sees a value that cannot be, or one that no valid reading of late gave.
5. Every stop that the algorithm did not ask for has a reason in the log.

The bound is one control period if commands reach the motor board. If a fault is on their way it is the board's
own deadman and two control periods: what a stop takes that no wire carries.

One thing is excused, because nothing on board can help it: the way to the board is broken, and its deadman is off (it
lost its power in the same moment) or is fed by the pieces of commands that still get through. Both are asked of the
simulated chip itself at that moment (``stops_by_s``), and ``excused`` counts them. Only wheels that turn on are excused
by this, never a command to move.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import inf, isfinite
from typing import NamedTuple

from wayfarer.control.modes import MAY_TURN, Mode
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Anomaly, Observation, Phase
from wayfarer.experiments.trial_setup import TrialSetup
from wayfarer.hal import STOP, CompassReading, Side, WheelCommand
from wayfarer.safety.conditions import MANUAL_LEVELS, Condition, Level, levels_for
from wayfarer.safety.power import SAME_DUTY
from wayfarer.simhal.chip_wiring import MotorBoard
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.simulated_world import SimulatedWorld

PERIODS = 2
KEPT = 20  # broken rules of one run; one is enough to know
ROUNDING_S = 1e-6


class SuspectedMotion(NamedTuple):
    """Wheels that turned at ``t_s`` although they were to stand since ``since_s``: ``told`` says so."""

    t_s: float
    since_s: float
    told: str


class SafetyRules(RunLog):
    """Watches one run: ``broken`` says which rules it broke, when and how, ``excused`` how often none could be kept."""

    def __init__(self) -> None:
        self.excused = 0
        self._broken: list[str] = []
        self._on_the_way: set[Fault] = set()
        self._way_free_since_s = -inf
        self._must_stand_since_s: float | None = 0.0
        self._not_armed_since_s: float | None = 0.0
        self._asked_to_arm = self._fault = self._moved = False
        self._no_motion_before_s = -inf
        self._why_stopped: str | None = None
        self._why_since_s = -inf
        self._stopped_by: str | None = None
        self._told_cause: str | None = None
        self._readings: deque[CompassReading] = deque()
        self._suspected: list[SuspectedMotion] = []

    @property
    def broken(self) -> tuple[str, ...]:
        """What was broken."""
        self._judge_suspected(may_move_from_s=inf)
        return tuple(self._broken)

    @property
    def bound_s(self) -> float:
        """How long the wheels may turn after a stop that nothing carries to them."""
        return self._deadman_s + PERIODS * self._period_s

    def follow(self, setup: TrialSetup) -> None:
        """Watch a trial's world and its controller."""
        self._controller, self._world = setup.supervisor.controller, setup.world
        self._levels = levels_for(setup.config.safety.on_lost_sense)  # not the controller's: it is what is checked
        self._board: MotorBoard | None = None if setup.injector is None else setup.injector.board
        self._period_s = 1.0 / setup.config.control_hz
        self._deadman_s = setup.rover.motors.deadman_s or 0.0
        self._by_hand_s = setup.config.manual.deadman_s
        self._stale_s = setup.config.detector.compass_stale_s
        self._warning_s = setup.config.safety.resume_warning_s
        after_each_step(setup.world, self._check_wheels)

    def note(self, t_s: float, fault: Fault, *, begins: bool) -> None:
        """Take the beginning of a fault, or its end: what is on the way to the motor board."""
        if fault.target != "motors" and not isinstance(fault.params, BusFault):
            return
        if begins:
            self._on_the_way.add(fault)
        else:
            self._on_the_way.discard(fault)
            self._way_free_since_s = t_s

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take an event: what arms and disarms, and what gives a stop its reason."""
        match name:
            case "arming":
                self._asked_to_arm = True
            case "armed":
                if not self._asked_to_arm:
                    self._break(t_s, "rule 1: the rover armed itself")
                self._asked_to_arm = self._fault = False
                self._not_armed_since_s = None
                self._no_motion_before_s = -inf
            case "disarmed" | "wheels_stopped":
                self._asked_to_arm = False
                self._not_armed_since_s = t_s
                self._stand_from(t_s)
                self._give_reason(t_s, details["reason"])
            case "hold":
                self._stand_from(t_s)
            case "manual":
                self._asked_to_arm = self._fault = False
                self._not_armed_since_s = None
                self._no_motion_before_s = -inf
                self._stand_from(t_s)
            case "manual_ended":
                self._not_armed_since_s = t_s if details["mode"] == "disarmed" else None
                self._stand_from(t_s)
                self._give_reason(t_s, details["reason"])
            case "health":
                self._told_cause = None if details["cause"] is None else str(details["cause"])
            case "motors_failed":
                self._give_reason(t_s, details["error"])
                self._no_motion_before_s = inf
            case "motors_opened":  # a person who drives must let go, and needs no warning
                by_hand = self._controller.mode is Mode.MANUAL
                self._no_motion_before_s = t_s if by_hand else t_s + self._warning_s

    def tick(self, record: TickRecord) -> None:
        """Check a control tick."""
        controller, t_s, moves = self._controller, record.t_s, record.applied != STOP
        self._check_told(t_s)
        by_hand = record.decision.phase is Phase.MANUAL
        levels = MANUAL_LEVELS if by_hand else self._levels
        worst = max((levels[condition] for condition in controller.conditions), default=Level.WELL)
        level = max(worst, record.level)
        not_armed_s = self._not_armed_since_s
        was_armed = not_armed_s is None or not_armed_s > t_s  # the board took its time, and somebody disarmed meanwhile
        may_turn = controller.mode in MAY_TURN or any(name == "disarmed" for _, name, _ in record.concluded)
        if moves and not (was_armed and (not_armed_s is not None or may_turn)):
            self._break(t_s, f"rule 1: motion commanded while {controller.mode.value}")
        if moves and by_hand and not self._is_wanted(record):
            self._break(t_s, f"rule 1: motion commanded by hand, and the newest sample is {record.manual}")
        if moves and level >= Level.HOLD:
            self._break(t_s, f"rule 2: motion commanded at level {level.name.lower()}")
        if moves and t_s < self._no_motion_before_s - ROUNDING_S:
            self._break(t_s, "rule 2: motion commanded for a motor board that failed, too soon")
        self._check_fault(record, controller.mode)
        self._check_seen(record)
        self._check_reason(record, moves=moves)
        if was_armed and level < Level.HOLD and (moves or not by_hand):
            self._must_stand_since_s = None if not_armed_s is None else self._must_stand_since_s
        else:
            self._stand_from(t_s)
        self._judge_suspected(may_move_from_s=t_s if self._must_stand_since_s is None else inf)

    def close(self, reason: str, text: str) -> None:
        """Check the end of a run."""
        if not (reason and text):
            self._break(self._world.t_s, f"rule 5: the run ended without a reason: {reason!r}, {text!r}")

    def _give_reason(self, t_s: float, reason: object) -> None:
        self._why_stopped, self._why_since_s = str(reason) or None, t_s

    def _stand_from(self, t_s: float) -> None:
        if self._must_stand_since_s is None:
            self._must_stand_since_s = t_s

    def _check_wheels(self) -> None:
        since_s, t_s, commanded = self._must_stand_since_s, self._world.t_s, self._world.commanded
        if since_s is None or commanded == (0.0, 0.0) or t_s <= since_s + self._allowed_s(since_s) + ROUNDING_S:
            return
        if self._way_is_broken(since_s) and self._board is not None and self._board.stops_by_s >= t_s - ROUNDING_S:
            self.excused += 1
        else:
            told = f"rule 2: wheels are commanded to {commanded[0]:.2f}, {commanded[1]:.2f} since {since_s:.2f} s"
            self._suspected.append(SuspectedMotion(t_s, since_s, told))

    def _judge_suspected(self, may_move_from_s: float) -> None:
        """Break the rule for wheels that turned, except since a tick that was to let them: its record comes last."""
        for t_s, since_s, told in self._suspected:
            if not since_s < may_move_from_s <= t_s:
                self._break(t_s, told)
        self._suspected.clear()

    def _allowed_s(self, since_s: float) -> float:
        return self.bound_s if self._way_is_broken(since_s) else self._period_s

    def _way_is_broken(self, since_s: float) -> bool:
        """Return whether a fault was on the way to the motor board at any time since."""
        return bool(self._on_the_way) or self._way_free_since_s >= since_s - self._period_s

    def _is_wanted(self, record: TickRecord) -> bool:
        """Return whether a person wants to move, a short time ago."""
        sample = record.manual
        wanted = sample is not None and (sample.forward, sample.turn) != (0.0, 0.0)
        return wanted and sample is not None and record.t_s - sample.sent_s <= self._by_hand_s + ROUNDING_S

    def _check_fault(self, record: TickRecord, mode: Mode) -> None:
        if self._fault and record.level is not Level.FAULT:
            self._break(record.t_s, "rule 3: a fault cleared by itself")
        self._fault |= record.level is Level.FAULT
        if self._fault and mode in MAY_TURN:
            self._break(record.t_s, "rule 3: a fault left the rover armed")

    def _check_seen(self, record: TickRecord) -> None:
        readings, reading, seen, t_s = self._readings, record.compass, record.observation, record.t_s
        if reading is not None and (not readings or reading is not readings[-1]):
            readings.append(reading)
        while readings and readings[0].t_s < t_s - self._stale_s - PERIODS * self._period_s:
            readings.popleft()
        if seen is None:
            return
        if not _is_possible(seen):
            self._break(t_s, f"rule 4: a decision saw {seen}")
        attitude = (seen.heading_deg, seen.pitch_deg, seen.roll_deg)
        said = Condition.HEADING_RECKONED in record.conditions  # that no reading is believed
        said |= record.decision.phase is Phase.MANUAL  # a person sees the rover, not its readings
        if record.decision.wheels != STOP and not said and attitude not in {each[1:4] for each in readings}:
            self._break(t_s, f"rule 4: a decision saw {attitude}, which no recent compass reading has")
        if not all(isfinite(duty) and abs(duty) <= 1.0 for duty in record.applied):
            self._break(t_s, f"rule 4: duties of {record.applied} were applied")

    def _check_reason(self, record: TickRecord, *, moves: bool) -> None:
        """Note what stops moving wheels; the log must name the gate's reason by the next tick (``_check_told``)."""
        if moves and self._why_since_s < record.t_s:  # else it is a reason to stop from the next tick on
            self._why_stopped = None
        elif self._moved and not moves:
            asked_for = record.decision.phase is not Phase.HALT and _stands(record.decision.wheels)
            gate = record.cause.value if record.cause is not None and record.level >= Level.HOLD else None
            if not (asked_for or gate or self._why_stopped):
                self._break(record.t_s, "rule 5: the wheels were stopped and the log does not say why")
            self._stopped_by = gate
        self._moved = moves

    def _check_told(self, t_s: float) -> None:
        """Check that what the gate stopped the wheels for at the tick before was written as an event."""
        stopped_by, self._stopped_by = self._stopped_by, None
        if stopped_by is not None and stopped_by != self._told_cause:
            self._break(t_s, f"rule 5: the wheels were stopped for {stopped_by}, and no event said so")

    def _break(self, t_s: float, what: str) -> None:
        if len(self._broken) < KEPT:
            self._broken.append(f"{t_s:.2f} s: {what}")


def _stands(wheels: WheelCommand) -> bool:
    """Return whether a board rounds these duties to zero."""
    return abs(wheels.left) <= SAME_DUTY >= abs(wheels.right)


def _is_possible(seen: Observation) -> bool:
    """Return whether everything that a decision saw can be."""
    contact = seen.contact
    bearing_deg = None if contact is None else contact.obstacle_bearing_deg
    return (
        0.0 <= seen.heading_deg < 360.0
        and abs(seen.pitch_deg) <= 180.0
        and abs(seen.roll_deg) <= 180.0
        and 0.0 <= seen.goal_heading_deg < 360.0
        and isfinite(seen.t_s)
        and 0.0 <= seen.travelled_m < inf
        and all(isinstance(anomaly, Anomaly) for anomaly in seen.anomalies)
        and (contact is None or all(isinstance(side, Side) for side in contact.sides))
        and (bearing_deg is None or 0.0 <= bearing_deg < 180.0)
    )


def after_each_step(world: SimulatedWorld, look: Callable[[], None]) -> None:
    """Have ``look`` called after each step of a world, before what is called already."""
    others = world.after_step

    def look_first(moved: SimulatedWorld) -> None:
        look()
        others(moved)

    world.after_step = look_first
