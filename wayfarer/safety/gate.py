"""The safety gate, the last stage before the wheels. Pure: the controller asks it once a tick and obeys.

Whatever the decision wants, the wheels get zero unless the rover is armed and nothing demands a hold; a fault stays
until the rover is re-armed. What passes is limited in duty and in how fast it may grow. Stopping is never limited.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Annotated

from annotated_types import Interval, MaxLen

from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import LEVELS, Condition, Level, worst
from wayfarer.units import Seconds

STALL_LIMIT_S = 0.2  # field.md, fault 37: ArduPilot's rover disarms after as long without its main loop
LOW_VOLTAGE_SHARE = 0.7  # of ``duty_max`` while the computer's supply sags: field catalogue, fault 32


@dataclass(frozen=True, slots=True)
class SafetySettings:
    """Limits at the gate, and what arming demands.

    ``slew_per_s`` bounds how fast a duty may grow: a motor start that resets the computer is the commonest trouble of
    such rovers. ``mission_*`` end a run normally. A rover whose compass is calibrated to less than ``calibration_min``
    (0 to 3) is not armed, nor one whose motor board cannot stop the wheels by itself, unless ``allow_no_deadman``. One
    whose board cannot be asked is armed once a person has seen that it does (``wayfarer check``), or where
    ``deadman_unproved_because`` says why nobody has; that is told at each arming. ``resume_warning_s`` is for how long
    the status light warns before a rover that held its wheels for more than a second by itself lets them turn again; 0
    for no warning.
    """

    duty_max: Annotated[float, Interval(gt=0, le=1)] = 1.0
    slew_per_s: Annotated[float, Interval(gt=0, le=1000)] = 8.0
    tick_late_s: Seconds = 0.2
    mission_time_s: Seconds = 3600.0
    mission_distance_m: Annotated[float, Interval(gt=0, le=1_000_000)] = 2000.0
    mission_radius_m: Annotated[float, Interval(gt=0, le=1_000_000)] = 300.0
    start_delay_s: Annotated[float, Interval(ge=0, le=600)] = 10.0
    resume_warning_s: Annotated[float, Interval(ge=0, le=60)] = 1.0
    settle_s: Seconds = 1.0
    settle_spread_deg: Annotated[float, Interval(gt=0, le=180)] = 3.0
    calibration_min: Annotated[int, Interval(ge=0, le=3)] = 2
    allow_no_deadman: bool = False
    deadman_unproved_because: Annotated[str, MaxLen(200)] = ""


class Gate:
    """Limits commands, holds and latches; ``level`` and ``cause`` say how severe the worst condition is and which.

    Once a tick ``judge``, then ``limit``.
    """

    def __init__(self, settings: SafetySettings, control_hz: float) -> None:
        self._duty_max = self._most = settings.duty_max
        self._step = settings.slew_per_s / control_hz
        self._left = self._right = 0.0
        self._fault: Condition | None = None
        self.level = Level.WELL
        self.cause: Condition | None = None
        self._holds = False

    def clear_fault(self) -> None:
        """Forget the latched fault; only arming does this."""
        self._fault = None
        self._judge(())

    def judge(self, conditions: Sequence[Condition]) -> bool:
        """Take this tick's conditions; return whether they let the wheels turn."""
        if conditions or self.cause is not None:
            self._judge(conditions)
        return not self._holds

    def limit(self, wanted: WheelCommand, *, armed: bool) -> WheelCommand:
        """Return what the wheels may get for one tick."""
        if self._holds or not armed:
            self._left = self._right = 0.0
            return STOP
        left, right = wanted
        step, most = self._step, self._most
        if abs(left - self._left) <= step and abs(right - self._right) <= step and abs(left) <= most >= abs(right):
            self._left, self._right = left, right
            return wanted
        if not (isfinite(left) and isfinite(right)):
            self._judge((Condition.DECISION_INVALID,))
            self._left = self._right = 0.0
            return STOP
        self._left = self._limit(left, self._left)
        self._right = self._limit(right, self._right)
        return WheelCommand(self._left, self._right)

    def _judge(self, conditions: Sequence[Condition]) -> None:
        """Find the worst condition; a fault stays."""
        self.cause = self._fault or worst(conditions)
        self.level = LEVELS[self.cause] if self.cause is not None else Level.WELL
        self._most = self._duty_max * (LOW_VOLTAGE_SHARE if Condition.UNDERVOLTAGE in conditions else 1.0)
        self._holds = self.level >= Level.HOLD
        if self.level is Level.FAULT:
            self._fault = self.cause

    def _limit(self, wanted: float, last: float) -> float:
        """Limit one side in duty and growth; less duty of the same sign, and zero, are given at once."""
        step, most = self._step, self._most
        if wanted > 0.0:
            return min(wanted, (last if last > 0.0 else 0.0) + step, most)
        return max(wanted, (last if last < 0.0 else 0.0) - step, -most)
