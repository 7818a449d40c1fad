"""Conditions from the motor board's reports: battery, drive faults, duties. Pure: time is an input.

A battery sags under load, so a voltage counts only once it has stayed below its limit for a while. Without limits it
is only logged: they depend on the chemistry, and a board that cannot measure (Sabertooth) gives none.

A board that says twice in a row that it applies other duties than it was commanded turns the wheels, or lets them
stand, by itself (fault catalogue, faults 23 and 30). Twice, because a stop may have come between.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from wayfarer.hal import MotorHealth, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.debounce import Debounce
from wayfarer.safety.settings import BoardSettings

SAME_DUTY: Final = 0.01  # a step of the coarsest board known, a Sabertooth's 1/127, and a bit


class MotorBoardMonitor:
    """Turns a board's answers into conditions; ``conditions`` are those of the latest answer.

    ``doubtful`` says that the latest answer disagreed with what was commanded: the next one decides.
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
        """Take an answer.

        Args:
            t_s: when it came.
            health: battery and faults.
            duties: what the board says that it applies, None where it cannot be asked.
            applied: what it took before, while and after it was asked: its answers and commands interleave.
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
        """Take note that the board did not answer: nothing is known of it now."""
        self.health = None
        self.conditions = (Condition.BOARD_SILENT,)


def _were_commanded(duties: WheelCommand, applied: Sequence[WheelCommand]) -> bool:
    """Return whether each side's duty was commanded; what is no number never was."""
    return all(any(abs(duty - command[side]) <= SAME_DUTY for command in applied) for side, duty in enumerate(duties))
