"""Detects a rover that cannot turn on the spot, or that turns the other way than its wheels are commanded.

A tree, or a branch under the belly, holds a body for a while. Ground with more grip than the motors can overcome holds
it everywhere. The rover cannot distinguish them, and in both cases more tries do not help.

On level ground nothing turns a body far against its own wheels. One that does has its motors exchanged, or both wired
the wrong way, or a compass that turns the wrong way: then each turn makes its heading worse. On a slope of mud a body
swings downhill, whatever its wheels do.
"""

from __future__ import annotations

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
# A compass that lags shows earlier turns for so long: 0.5 s (``simhal.world.physics.FIELD``), and a body coasts.
SHOWS_LATE_S: Final = 0.7
# Turned so far the other way in one turn on the spot, the wheels do the opposite. The motors' field bends a heading by
# less (``FIELD``: 8 degrees for each side). Chosen by us.
OPPOSES_DEG: Final = 45.0


class TurnabilityMonitor:
    """Counts the tries in a row in which full duty on the spot did not turn the rover, and watches the way it turns.

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
        self._reversed = False
        self._turning_s = self._shown_from_deg = 0.0

    def update(self, interval: TickInterval, gained_deg: float, *, free: bool) -> tuple[Condition, ...]:
        """Judge a tick.

        Args:
            interval: the wheel commands before it.
            gained_deg: the heading gained since the start of the run, clockwise positive.
            free: whether the ground is level, and the heading neither in doubt nor reckoned from the commands.
        """
        left, right = interval.commanded
        if self._reversed:
            return (Condition.DRIVE_REVERSED,)
        if not -AHEAD_SHARE <= (left + right) / (left - right or 1.0) <= AHEAD_SHARE:
            self._way = 0.0
            return self._found
        duty = (left - right) / 2.0
        if duty * self._way <= 0.0:
            self._way, self._from_deg, self._tried_s, self._turning_s = duty, gained_deg, 0.0, 0.0
        sign = 1.0 if duty > 0.0 else -1.0
        self._turning_s += interval.driven_s
        if not free or self._turning_s < SHOWS_LATE_S:
            self._shown_from_deg = gained_deg
        self._reversed = sign * (gained_deg - self._shown_from_deg) <= -OPPOSES_DEG
        turned_deg = sign * (gained_deg - self._from_deg)
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
