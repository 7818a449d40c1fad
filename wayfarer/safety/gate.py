"""The safety gate, the last stage before the wheels, and its warning. Pure: the controller asks both once per tick.

For every decision, the wheels get zero unless the rover is armed and no condition demands a hold; a fault stays until
the rover is re-armed. A command that passes is limited in duty and in the growth of duty. Stopping is never limited.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, isfinite
from typing import Final

from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import DUTY_SHARES, LEVELS, Condition, Level, levels_for, worst
from wayfarer.safety.settings import SafetySettings
from wayfarer.safety.tick_interval import TickInterval

# ArduPilot's rover disarms after this time without its main loop. Here, because the stall guard
# (``daemon.watchdog``) keeps it, and a rover file's control rate is checked against it.
STALL_LIMIT_S: Final = 0.2


class Gate:
    """Limits commands, holds the wheels, and latches faults.

    Once per tick, call ``judge``, and if it says so, ``limit``. ``cause`` is the worst condition, ``level`` its
    severity, ``holds`` whether it keeps the wheels at zero. ``levels`` are the severities of this rover's conditions;
    others count from the next tick on.
    """

    def __init__(self, settings: SafetySettings, control_hz: float) -> None:
        self.levels = levels_for(settings.on_lost_sense)
        self._duty_max = self._most = settings.duty_max
        self._step = settings.slew_per_s / control_hz
        self._left = self._right = 0.0
        self._fault: Condition | None = None
        self.level = Level.WELL
        self.cause: Condition | None = None
        self.holds = False
        self._open = False

    def clear_fault(self) -> None:
        """Forget the latched fault; only a person who arms or drives does this."""
        self._fault = None
        self._judge(())

    def judge(self, conditions: Sequence[Condition], *, armed: bool) -> bool:
        """Return whether the wheels may turn in this tick; if not, no manoeuvre is asked, so that it waits.

        Args:
            conditions: of this tick.
            armed: whether the rover is armed, or a person drives it.
        """
        if conditions or self.cause is not None:
            self._judge(conditions)
        self._open = armed and not self.holds
        if not self._open:
            self._left = self._right = 0.0
        return self._open

    def limit(self, wanted: WheelCommand) -> WheelCommand:
        """Return what the wheels may get in this tick; a command that is not a number stops them and is a fault."""
        if not self._open:
            return STOP
        left, right = wanted.left, wanted.right
        step, most = self._step, self._most
        if (  # nearly every command ends here; written so that NaN does not
            abs(left - self._left) <= step
            and abs(right - self._right) <= step
            and abs(left) <= most
            and abs(right) <= most
        ):
            self._left, self._right = left, right
            return wanted
        if not (isfinite(left) and isfinite(right)):
            self._judge((Condition.DECISION_INVALID,))
            self._left = self._right = 0.0
            self._open = False
            return STOP
        self._left = self._limit_side(left, self._left)
        self._right = self._limit_side(right, self._right)
        return WheelCommand(self._left, self._right)

    def _judge(self, conditions: Sequence[Condition]) -> None:
        """Find the worst condition; a fault stays."""
        self.cause = self._fault or worst(conditions, self.levels)
        self.level = self.levels[self.cause] if self.cause is not None else Level.WELL
        self._most = self._duty_max * min(map(DUTY_SHARES.__getitem__, conditions), default=1.0)
        self.holds = self.level >= Level.HOLD
        if self.level is Level.FAULT:
            self._fault = self.cause

    def _limit_side(self, wanted: float, last: float) -> float:
        """Limit one side in duty and in growth; zero, and less duty of the same sign, pass at once."""
        step, most = self._step, self._most
        if wanted > 0.0:
            return min(wanted, (last if last > 0.0 else 0.0) + step, most)
        return max(wanted, (last if last < 0.0 else 0.0) - step, -most)


# -- the warning before a rover that was held continues by itself ----------------------------------------------------
# A person may have walked up to a rover that has stopped. A hold that the rover began by itself (a silent sensor, a
# late tick) can end at any moment. So after a long one the wheels stay stopped for one more second, while the status
# light blinks as before the start. A hold that a person requested is ended by a person, who looks first, so it needs no
# warning. A hold for a motor board that failed is always followed by the warning, however short it was.

LONG_HOLD_S: Final = 1.0  # nobody walks up to a rover that stops for less
FREE_S: Final = 0.5  # if the wheels turn for less than this between two holds, the rover still counts as standing


class ResumeWarning:
    """Says whether the wheels must still wait. Call it at each tick of an armed rover.

    ``warning_s`` is the length of the warning, 0 for none; ``levels`` are the severities of this rover's conditions.
    """

    def __init__(self, warning_s: float, levels: Mapping[Condition, Level] = LEVELS) -> None:
        self._warning_s = warning_s
        self._levels = levels
        self.reset()

    def reset(self) -> None:
        """Forget: a mission begins, and its start delay has warned already."""
        self._stands_since_s: float | None = None
        self._free_since_s: float | None = None
        self._due = False
        self._until_s = -inf

    def update(self, interval: TickInterval, conditions: Sequence[Condition]) -> bool:
        """Judge a tick with its conditions; return whether the rover warns now."""
        if self._stands_since_s is None and not conditions:
            return False  # nearly every tick ends here
        t_s = interval.t_s
        if any(self._levels[each] >= Level.HOLD and each is not Condition.OPERATOR_HOLD for each in conditions):
            # The rover itself holds its wheels; in an interval that was late the board's deadman had stopped them.
            if self._stands_since_s is None:
                self._stands_since_s = t_s - interval.dt_s
            self._free_since_s = None
            self._due |= t_s - self._stands_since_s > LONG_HOLD_S or Condition.MOTORS_FAILED in conditions
            return False
        if self._stands_since_s is None or Condition.OPERATOR_HOLD in conditions:
            return False  # a warning that is due waits for the person
        if self._due:
            self._due, self._until_s = False, t_s + self._warning_s
        if t_s < self._until_s:
            return True
        self._free_since_s = t_s if self._free_since_s is None else self._free_since_s
        if t_s - self._free_since_s >= FREE_S:
            self._stands_since_s = None
        return False
