"""Conditions from the power: what the motor board and the computer's supply report. Pure: time is an input.

The voltage of a battery drops under load, so it counts only once it has stayed below its limit for a while. Without
limits it is only logged: they depend on the chemistry, and some boards (Sabertooth) do not measure it.

A board that reports twice in a row other duties than it was commanded does not obey (fault catalogue, faults 23 and
30). Twice, because a stop may have been sent between command and report.

A supply of the computer whose voltage drops when the motors start can reset it. So the rover continues with less duty
while the voltage is too low, and for a minute if it drops repeatedly. A motor board that loses its power for a moment
hangs on the same battery: that is a drop as well.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import inf
from typing import Final

from wayfarer.hal import MotorHealth, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.settings import BoardSettings
from wayfarer.safety.tick_interval import Debounce

SAME_DUTY: Final = 0.01  # a step of the coarsest board known, a Sabertooth's 1/127, and a bit
# The firmware's power and heat flags of a Raspberry Pi: bits 0 to 3 are the state now, 16 to 19 what happened since
# boot (docs/reference/hardware.md).
UNDER_VOLTAGE_NOW: Final = 0x1
SLOWED_NOW: Final = 0xE
UNDER_VOLTAGE_SINCE_BOOT: Final = 0x10000
SLOWED_SINCE_BOOT: Final = 0xE0000
# "Repeated 3x/min": fault catalogue, fault 32.
DIPS: Final = 3
DIPS_S: Final = 60.0


class MotorBoardMonitor:
    """Turns a board's reports into conditions; ``conditions`` are those of the latest report.

    ``doubtful`` says that the latest report disagreed with the commands; the next one decides.
    """

    def __init__(self, settings: BoardSettings) -> None:
        self._low_v = settings.battery_low_v or 0.0
        self._critical_v = settings.battery_critical_v or 0.0
        self._low = Debounce(settings.battery_low_s)
        self._critical = Debounce(settings.battery_critical_s)
        self._faulty = self.doubtful = False
        self.health: MotorHealth | None = None
        self.conditions: tuple[Condition, ...] = ()

    def update(
        self, t_s: float, health: MotorHealth, duties: WheelCommand | None = None, applied: Sequence[WheelCommand] = ()
    ) -> None:
        """Judge a report.

        Args:
            t_s: when it arrived.
            health: battery and faults.
            duties: the duties that the board reports, None if it cannot report them.
            applied: the commands before, during and after the request: requests and commands interleave.
        """
        self.health = health
        conditions = [Condition.MOTORS_FAILED] if health.faults and self._faulty else []
        self._faulty = bool(health.faults)
        disagrees = duties is not None and not _were_commanded(duties, applied)
        if disagrees and self.doubtful:
            conditions.append(Condition.BOARD_DISAGREES)
        self.doubtful = disagrees
        if health.battery_v is not None:
            if self._low.update(t_s, health.battery_v < self._low_v):
                conditions.append(Condition.BATTERY_LOW)
            if self._critical.update(t_s, health.battery_v < self._critical_v):
                conditions.append(Condition.BATTERY_CRITICAL)
        self.conditions = tuple(conditions)

    def silent(self) -> None:
        """Note that the board did not answer: its state is unknown now."""
        self.health = None
        self.conditions = (Condition.BOARD_SILENT,)


def _were_commanded(duties: WheelCommand, applied: Sequence[WheelCommand]) -> bool:
    """Return whether each side's duty was commanded; NaN never was."""
    left = right = False
    for command in applied:
        left = left or abs(duties.left - command.left) <= SAME_DUTY
        right = right or abs(duties.right - command.right) <= SAME_DUTY
    return left and right


class SupplyMonitor:
    """Turns the firmware's flags, and losses of the motor board's power, into conditions.

    ``flags`` are the latest, None if the computer does not report any. ``noticed`` says whether the voltage has dropped
    so far: before that there is no condition.
    """

    def __init__(self) -> None:
        self.flags: int | None = None
        self.noticed = False
        self._dips_s = deque([-inf] * DIPS, maxlen=DIPS)

    def update(self, t_s: float, flags: int | None) -> None:
        """Take flags that have changed at ``t_s``."""
        was_low, self.flags = self._is_low, flags
        if self._is_low and not was_low:
            self.dip(t_s)

    def dip(self, t_s: float) -> None:
        """Count a drop of the voltage at ``t_s``; the motor board's own counts here as well."""
        self._dips_s.append(t_s)
        self.noticed = True

    def conditions(self, t_s: float) -> tuple[Condition, ...]:
        """Return the conditions at ``t_s``: less duty while it is low, and if it drops too often."""
        low = (Condition.UNDERVOLTAGE,) if self._is_low else ()
        return (*low, Condition.POWER_UNSTABLE) if t_s - self._dips_s[0] < DIPS_S else low

    @property
    def _is_low(self) -> bool:
        return bool((self.flags or 0) & UNDER_VOLTAGE_NOW)


def meaning(flags: int) -> str:
    """Return the meaning of flags, in words."""
    said = {
        UNDER_VOLTAGE_NOW: "under-voltage now",
        SLOWED_NOW: "slowed down now",
        UNDER_VOLTAGE_SINCE_BOOT: "under-voltage since boot",
        SLOWED_SINCE_BOOT: "slowed down since boot",
    }
    return ", ".join(text for bits, text in said.items() if flags & bits) or "all well"
