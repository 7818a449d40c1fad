"""The warning before a rover that was held drives on by itself. Pure: called at each tick of an armed rover.

A person may have stepped up to a rover that has stopped. A hold that the rover began by itself (a silent sensor, a late
tick) can end at any moment, so after a long one the wheels stand for a second more, while the status light blinks as it
does before the start. A person's own hold is ended by a person, who looks first: it needs no warning.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Final

from wayfarer.safety.conditions import LEVELS, Condition, Level
from wayfarer.safety.interval import Interval

LONG_HOLD_S: Final = 1.0  # nobody steps up to a rover that stops for less
FREE_S: Final = 0.5  # wheels that turn for less, between two holds, do not drive off: the rover still stands


class ResumeWarning:
    """Tells whether the wheels must still wait; ``warning_s`` is for how long the light warns, 0 for not at all."""

    def __init__(self, warning_s: float) -> None:
        self._warning_s = warning_s
        self.reset()

    def reset(self) -> None:
        """Forget: a mission begins, and its start delay has warned already."""
        self._stands_since_s: float | None = None
        self._free_since_s: float | None = None
        self._due = False
        self._until_s = -inf

    def update(self, interval: Interval, conditions: Sequence[Condition]) -> bool:
        """Take a tick with what is wrong at it; return whether it is time to warn."""
        if self._stands_since_s is None and not conditions:
            return False  # as nearly always, 20 times a second
        t_s = interval.t_s
        if _holds(conditions):
            self._stand(interval)
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

    def _stand(self, interval: Interval) -> None:
        """Note that the rover holds its wheels; in an interval that was late the board's deadman had stopped them."""
        if self._stands_since_s is None:
            self._stands_since_s = interval.t_s - interval.dt_s
        self._free_since_s = None
        self._due = interval.t_s - self._stands_since_s > LONG_HOLD_S


def _holds(conditions: Sequence[Condition]) -> bool:
    """Return whether the rover itself holds its wheels."""
    return any(LEVELS[each] >= Level.HOLD and each is not Condition.OPERATOR_HOLD for each in conditions)
