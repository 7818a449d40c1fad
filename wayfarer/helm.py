"""The helm: arming, the control tick and the mission limits. It alone commands the wheels while a run lasts.

A tick always goes the same way::

    snapshot of cells -> detector -> escape handler -> safety gate -> motors -> one log record
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import inf

from wayfarer.arming import Arming
from wayfarer.conditions import Condition, Level
from wayfarer.config import RoverConfig
from wayfarer.detector import Detector
from wayfarer.errors import DriverError
from wayfarer.escape.api import Anomaly, Decision, EscapeHandler, Observation, Phase
from wayfarer.hal import STOP, DriveMotors, WheelCommand
from wayfarer.latest import Cells, Snapshot
from wayfarer.records import RunLog, TickRecord
from wayfarer.safety import Gate

_STAND = Decision(STOP, Phase.HALT, Phase.HALT.value)


class Mode(Enum):
    """What the run is in; only ``ARMED`` may move the wheels."""

    DISARMED = "disarmed"
    ARMING = "arming"
    ARMED = "armed"


@dataclass(frozen=True, slots=True)
class RunEnd:
    """Why a run ended: a fixed reason such as ``requested`` or ``mission_time``, and a sentence for a person."""

    reason: str
    text: str


# Members of an Enum are found slowly through its class, and the tick asks 20 times a second.
_ARMED = Mode.ARMED
_FAULT = Level.FAULT


class Helm:
    """Ticks; ``end`` is None until something ends the run."""

    def __init__(
        self, motors: DriveMotors, cells: Cells, config: RoverConfig, detector: Detector, handler: EscapeHandler,
        log: RunLog,
    ) -> None:  # fmt: skip
        self._motors = motors
        self._cells = cells
        self._safety = config.safety
        self._late_s = config.safety.tick_late_s
        self._half_speed_m_s = config.vehicle.max_speed_m_s / 2
        self._detector = detector
        self._handler = handler
        self._log = log
        self._gate = Gate(config.safety, config.control_hz)
        self.mode = Mode.DISARMED
        self.end: RunEnd | None = None
        self._arming: Arming | None = None
        self._ends_s = self._ends_m = inf
        self._goal_heading_deg = 0.0
        self._travelled_m = 0.0
        self._applied = STOP
        self._motors_failed = False
        self._last_t_s: float | None = None
        self._last_cause: Condition | None = None

    # -- commands ------------------------------------------------------------------------------------------------

    def arm(self, t_s: float, goal_heading_deg: float | None) -> None:
        """Begin to arm: after the start delay the wheels may turn. See ``Arming`` for the goal heading."""
        self._motors_failed = False
        self._ends_s = self._ends_m = inf
        self._arming = Arming(self._safety, t_s, goal_heading_deg)
        self.mode = Mode.ARMING
        self._log.event("arming", t_s, start_delay_s=self._safety.start_delay_s)

    def disarm(self, t_s: float, reason: str) -> None:
        """Stop the wheels from the next tick on, until armed anew."""
        self.mode = Mode.DISARMED
        self._arming = None
        self._ends_s = self._ends_m = inf
        self._log.event("disarmed", t_s, reason=reason)

    def finish(self, reason: str, text: str) -> None:
        """End the run; the first reason stands."""
        if self.end is None:
            self.end = RunEnd(reason, text)

    # -- the tick ------------------------------------------------------------------------------------------------

    async def tick(self, t_s: float) -> None:
        """Do one control tick at time ``t_s``."""
        if self._last_t_s is None:
            self._last_t_s = t_s
        dt_s, self._last_t_s = t_s - self._last_t_s, t_s
        applied = self._applied
        self._travelled_m += abs(applied.left + applied.right) * self._half_speed_m_s * dt_s
        snapshot = self._cells.snapshot(t_s)
        anomalies, conditions = self._detector.update(snapshot, applied)
        if dt_s > self._late_s or self._motors_failed:
            conditions = self._own_conditions(conditions, dt_s)
        if self._arming is not None:
            self._continue_arming(t_s, self._arming, conditions)
        observation = self._observe(snapshot, anomalies)
        armed = self.mode is _ARMED
        decision = self._handler.decide(observation) if armed and observation is not None else _STAND
        gate = self._gate
        wheels = gate.update(decision.wheels, conditions, armed=armed)
        try:
            self._applied = applied = await self._motors.drive(wheels)
        except DriverError as error:
            self._applied = applied = self._lose_motors(t_s, error)
        self._log.tick(
            TickRecord(t_s, snapshot, observation, decision, applied, gate.level, gate.cause, self._handler.memory)
        )
        if gate.cause is not self._last_cause or (armed and gate.level is _FAULT):
            self._note_health(t_s, gate.level, gate.cause)
        if t_s >= self._ends_s or self._travelled_m >= self._ends_m:
            self._end_mission(t_s)

    def _observe(self, snapshot: Snapshot, anomalies: tuple[Anomaly, ...]) -> Observation | None:
        """Return what the handler may see, or None before the first believable heading."""
        compass = self._detector.compass
        if compass is None:
            return None
        _, heading_deg, pitch_deg, roll_deg, _ = compass
        return Observation(
            snapshot.t_s,
            heading_deg,
            pitch_deg,
            roll_deg,
            anomalies,
            snapshot.contact,
            self._goal_heading_deg,
            self._travelled_m,
        )

    def _own_conditions(self, conditions: tuple[Condition, ...], dt_s: float) -> tuple[Condition, ...]:
        """Add what the helm itself knows to what the detector found."""
        if dt_s > self._late_s:
            conditions += (Condition.TICK_LATE,)
        if self._motors_failed:
            conditions += (Condition.MOTORS_FAILED,)
        return conditions

    def _continue_arming(self, t_s: float, arming: Arming, conditions: tuple[Condition, ...]) -> None:
        compass = self._detector.compass
        goal_heading_deg = arming.update(compass) if compass is not None else None
        if goal_heading_deg is not None and not conditions:
            self._begin_mission(t_s, goal_heading_deg)
        elif arming.too_late(t_s):
            causes = ", ".join(condition.value for condition in conditions) or "the heading did not settle"
            self.disarm(t_s, f"not armed: {causes}")

    def _begin_mission(self, t_s: float, goal_heading_deg: float) -> None:
        self._arming = None
        self._gate.clear_fault()
        self._handler.reset()
        self._goal_heading_deg = goal_heading_deg
        self._ends_s = t_s + self._safety.mission_time_s
        self._ends_m = self._travelled_m + self._safety.mission_distance_m
        self.mode = Mode.ARMED
        self._log.event("armed", t_s, goal_heading_deg=goal_heading_deg)

    def _lose_motors(self, t_s: float, error: DriverError) -> WheelCommand:
        """Without an acknowledgement nobody knows what the wheels do: latch a fault; the board's deadman stops them."""
        self._motors_failed = True
        self._log.event("motors_failed", t_s, error=str(error))
        return STOP

    def _note_health(self, t_s: float, level: Level, cause: Condition | None) -> None:
        self._last_cause = cause
        self._log.event("health", t_s, level=level.name.lower(), cause=cause.value if cause is not None else None)
        if level is Level.FAULT and self.mode is not Mode.DISARMED:
            self.disarm(t_s, f"fault: {cause.value if cause is not None else 'unknown'}")

    def _end_mission(self, t_s: float) -> None:
        safety = self._safety
        if t_s >= self._ends_s:
            self.finish("mission_time", f"the mission limit of {safety.mission_time_s:g} s was reached")
        else:
            self.finish("mission_distance", f"the mission limit of {safety.mission_distance_m:g} m was reached")
