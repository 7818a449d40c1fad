"""The warning before a rover that was held continues by itself. Pure: called at each tick of an armed rover.

A person may have walked up to a rover that has stopped. A hold that the rover began by itself (a silent sensor, a late
tick) can end at any moment. So after a long one the wheels stand for a second more, while the status light blinks as
before the start. A hold that a person requested is ended by a person, who looks first, so it needs no warning. A hold
for a motor board that failed is always followed by the warning, however short it was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Final

from wayfarer.safety.conditions import LEVELS, Condition, Level
from wayfarer.safety.tick_interval import TickInterval

LONG_HOLD_S: Final = 1.0  # nobody walks up to a rover that stops for less
FREE_S: Final = 0.5  # if the wheels turn for less than this between two holds, the rover still counts as standing


class ResumeWarning:
    """Says whether the wheels must still wait.

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
        if self._holds(conditions):
            self._stand(interval, conditions)
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

    def _stand(self, interval: TickInterval, conditions: Sequence[Condition]) -> None:
        """Note that the rover holds its wheels; in an interval that was late the board's deadman had stopped them."""
        if self._stands_since_s is None:
            self._stands_since_s = interval.t_s - interval.dt_s
        self._free_since_s = None
        if interval.t_s - self._stands_since_s > LONG_HOLD_S or Condition.MOTORS_FAILED in conditions:
            self._due = True

    def _holds(self, conditions: Sequence[Condition]) -> bool:
        """Return whether the rover itself holds its wheels."""
        return any(self._levels[each] >= Level.HOLD and each is not Condition.OPERATOR_HOLD for each in conditions)
