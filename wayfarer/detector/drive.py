"""Whether the rover turns as its wheels are told to: a side that is dead, weak or reversed shows in the heading.

A turn that is blocked (nothing is measured) is the forest's doing and no fault.
"""

from __future__ import annotations

from collections import deque
from math import copysign, degrees, inf

from wayfarer.conditions import Condition
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Vehicle
from wayfarer.interval import Interval

# What a window shows: the side that lags behind, or wheels that go the wrong way.
LEFT, RIGHT, REVERSED = -1, 1, 0
# What a window is of: driving ahead or back, or turning on the spot.
AHEAD, BACK, CLOCKWISE, ANTICLOCKWISE = 1, -1, 2, -2


# Sums since the start of the run, in degrees: what each side was told to turn the rover by itself (the left one
# clockwise, the right one back), what both were told to turn it either way, and what it has turned clockwise. A plain
# tuple, because one is made 20 times a second.
Moment = tuple[float, float, float, float, float]  # t_s, left_deg, right_deg, either_deg, gained_deg


class DriveWatch:
    """Compares the heading gained with the turn commanded, over a window of driving or turning one way.

    ``condition`` is what was shown last, and stays until ``until_t_s``.
    """

    def __init__(self, settings: DetectorSettings, vehicle: Vehicle) -> None:
        self._settings = settings
        self._window_s = settings.drive_window_s + 1e-6  # sums of periods are off by a rounding error
        self._lag_s = settings.drive_lag_s
        self._least_deg = min(settings.drive_margin_deg / 2, settings.reversed_back_deg)
        self._from_duty = 2 * settings.drive_from_m_s / vehicle.max_speed_m_s
        self._deg_s_per_duty = degrees(vehicle.max_speed_m_s / vehicle.track_m)
        self._left_deg_s = self._right_deg_s = 0.0
        self._left_deg = self._right_deg = self._either_deg = 0.0
        self._way = AHEAD
        self._window: deque[Moment] = deque()
        self._told: deque[tuple[float, int]] = deque()
        self.condition = Condition.DRIVE_ASYMMETRY
        self.until_t_s = -inf

    def update(self, interval: Interval, gained_deg: float, *, trusted: bool) -> None:
        """Take in a tick: what the wheels were told since the last, and the heading gained since the start of the run.

        It is ``trusted`` unless the compass is in doubt, or the forest is in the way: such windows are dropped.
        """
        t_s, _, driven_s, (left, right), _ = interval
        share, deg_s_per_duty = driven_s / (driven_s + self._lag_s), self._deg_s_per_duty
        left_deg_s = self._left_deg_s = self._left_deg_s + (left * deg_s_per_duty - self._left_deg_s) * share
        right_deg_s = self._right_deg_s = self._right_deg_s + (right * deg_s_per_duty - self._right_deg_s) * share
        self._left_deg += left_deg_s * driven_s
        self._right_deg += right_deg_s * driven_s
        self._either_deg += abs(left_deg_s - right_deg_s) * driven_s
        duty = left + right
        if abs(duty) >= self._from_duty:
            way = AHEAD if duty > 0.0 else BACK
        else:
            way = CLOCKWISE if left > right else ANTICLOCKWISE
        window = self._window
        if way != self._way or not trusted:
            self._way = way
            window.clear()
        window.append((t_s, self._left_deg, self._right_deg, self._either_deg, gained_deg))
        while t_s - window[0][0] > self._window_s:
            window.popleft()
        _, left_then_deg, right_then_deg, either_then_deg, gained_then_deg = window[0]
        measured_deg = gained_deg - gained_then_deg
        if -self._least_deg < measured_deg < self._least_deg:
            return  # as nearly always; a rover that is held turns no more than that
        left_deg, right_deg = self._left_deg - left_then_deg, self._right_deg - right_then_deg
        if way in (AHEAD, BACK):
            self._compare(t_s, left_deg, right_deg, self._either_deg - either_then_deg, measured_deg)
        else:
            self._check_sense(t_s, left_deg - right_deg, measured_deg)

    def _compare(self, t_s: float, left_deg: float, right_deg: float, either_deg: float, measured_deg: float) -> None:
        """Look for a side that lags behind: if it is the left one, the rover turns left ahead, right in reverse."""
        settings, commanded_deg = self._settings, left_deg - right_deg
        excess_deg = measured_deg - commanded_deg
        if abs(excess_deg) <= settings.drive_margin_deg + settings.drive_margin_share * abs(commanded_deg):
            return
        way = copysign(1.0, excess_deg)
        that_way_deg = (either_deg + way * commanded_deg) / 2
        if way * measured_deg < that_way_deg + settings.drive_margin_deg / 2:
            return  # no more than it was told to turn that way: it was held for a while, as by a tree
        side, dead_deg = (LEFT, left_deg) if excess_deg * self._way < 0.0 else (RIGHT, right_deg)
        self._tell(t_s, side, settings.drive_uneven_windows)
        if abs(excess_deg) > settings.reversed_share * abs(dead_deg) + settings.reversed_margin_deg:
            self._tell(t_s, REVERSED, settings.reversed_turns)

    def _check_sense(self, t_s: float, commanded_deg: float, measured_deg: float) -> None:
        """Look for a turn on the spot that goes the other way."""
        settings = self._settings
        way = 1.0 if self._way == CLOCKWISE else -1.0
        if way * commanded_deg >= settings.reversed_turn_deg and way * measured_deg <= -settings.reversed_back_deg:
            self._tell(t_s, REVERSED, settings.reversed_turns)

    def _tell(self, t_s: float, what: int, limit: int) -> None:
        """Take note of what a window shows, once in its length; so many alike within memory are a fault."""
        told = self._told
        while told and t_s - told[0][0] > self._settings.drive_memory_s:
            told.popleft()
        alike = [when_s for when_s, each in told if each == what]
        if alike and t_s - alike[-1] < self._window_s:
            return
        told.append((t_s, what))
        failed = len(alike) + 1 >= limit
        if failed:
            told.clear()  # whoever arms the rover anew has seen to it
            self._window.clear()
        self.condition = Condition.DRIVE_FAILED if failed else Condition.DRIVE_ASYMMETRY
        self.until_t_s = t_s + self._window_s
