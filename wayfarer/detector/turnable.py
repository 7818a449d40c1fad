"""Detects a rover that cannot turn on the spot: repeated full turn duty without rotation.

A tree, or a branch under the belly, holds a body for a while. Ground with more grip than the motors can overcome holds
it everywhere. The rover cannot distinguish them, and in both cases more tries do not help.
"""

from __future__ import annotations

from math import copysign
from typing import Final

from wayfarer.detector.settings import DetectorSettings
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import ROUNDING_S, TickInterval

# What counts as full duty, as a share of the duty that the gate allows: an undervoltage leaves 0.7 of it, and a
# Sabertooth rounds to 127 steps.
FULL_SHARE: Final = 0.65
# In a turn on the spot, driving ahead is at most this share of turning.
AHEAD_SHARE: Final = 0.2
# A body that turned by this much can turn: three times what counts as no turn at all.
TURNS_DEG: Final = 9.0


class TurnabilityMonitor:
    """Counts the tries in a row in which full duty on the spot did not turn the rover.

    Args:
        settings: how long a try is, and how many failed tries are reported or end the mission.
        duty_max: the highest duty that the gate allows, above 0 to 1.
    """

    def __init__(self, settings: DetectorSettings, duty_max: float) -> None:
        self._settings = settings
        self._full = FULL_SHARE * duty_max
        self._try_s = settings.cannot_turn_s - ROUNDING_S
        self.reset()

    def reset(self) -> None:
        """Forget all tries."""
        self._found: tuple[Condition, ...] = ()
        self._tries = 0
        self._way = 0.0
        self._from_deg = self._tried_s = 0.0

    def update(self, interval: TickInterval, gained_deg: float) -> tuple[Condition, ...]:
        """Judge a tick: the wheel commands before it, and the heading gained since the start of the run."""
        left, right = interval.commanded
        if not -AHEAD_SHARE <= (left + right) / (left - right or 1.0) <= AHEAD_SHARE:
            self._way = 0.0
            return self._found
        duty = (left - right) / 2.0
        if duty * self._way <= 0.0:
            self._way, self._from_deg, self._tried_s = duty, gained_deg, 0.0
        turned_deg = copysign(1.0, duty) * (gained_deg - self._from_deg)
        if turned_deg >= TURNS_DEG:
            self._found, self._tries = (), 0
            self._from_deg, self._tried_s = gained_deg, 0.0
        elif abs(duty) >= self._full:
            before_s, self._tried_s = self._tried_s, self._tried_s + interval.driven_s
            if before_s < self._try_s <= self._tried_s:
                self._tries += 1
                return self._judge()
        return self._found

    def _judge(self) -> tuple[Condition, ...]:
        if self._tries >= self._settings.cannot_turn_max:
            self._found, self._tries = (), 0
            return (Condition.CANNOT_TURN, Condition.ENTRAPPED)
        if self._tries >= self._settings.cannot_turn_tries:
            self._found = (Condition.CANNOT_TURN,)
        return self._found
