"""Conditions from the motor board's reports: battery, drive faults, duties. Pure: time is an input.

The voltage of a battery drops under load, so it counts only once it has stayed below its limit for a while. Without
limits it is only logged: they depend on the chemistry, and some boards (Sabertooth) do not measure it.

A board that reports twice in a row other duties than it was commanded does not obey (fault catalogue, faults 23 and
30). Twice, because a stop may have been sent between command and report.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from wayfarer.hal import MotorHealth, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.settings import BoardSettings
from wayfarer.safety.tick_interval import Debounce

SAME_DUTY: Final = 0.01  # a step of the coarsest board known, a Sabertooth's 1/127, and a bit


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
            duties: the duties that the board reports, None where it cannot report them.
            applied: the commands before, during and after the request: requests and commands interleave.
        """
        self.health = health
        conditions = [Condition.BOARD_FAULT] if health.faults and self._faulty else []
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
    return all(any(abs(duty - command[side]) <= SAME_DUTY for command in applied) for side, duty in enumerate(duties))
