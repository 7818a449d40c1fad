"""Whether the rover turns as its wheels are told to: a side that is dead, weak or reversed shows in the heading.

It is judged by what a healthy drive can do on any ground. Ground that grips holds a body back, so a turn may be any
part of what was told, down to none; ground that is slippery lets it turn on for a while. No ground turns it further
than it was told or the other way, as a dead side does. A trunk along which it slides does so now and then; a drive that
turns as told, in a window in which a dead side would have shown, is cleared of what was found before.
"""

from __future__ import annotations

from collections import deque
from math import copysign, degrees, hypot, inf

from wayfarer.conditions import Condition
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Vehicle
from wayfarer.hal import WheelCommand
from wayfarer.interval import Interval

# What a window shows: the side that lags behind, or wheels that go the wrong way.
LEFT, RIGHT, REVERSED = -1, 1, 0
RATE, AHEAD_M = 5, 6  # places in a ``Moment``
# What a window is of: driving ahead or back, or turning on the spot.
AHEAD, BACK, CLOCKWISE, ANTICLOCKWISE = 1, -1, 2, -2

# Wheels stand about three quarters of the way from the middle of a body to its corners, and its weight is spread
# evenly: a friction f stops its turning with f g times this, over the diagonal of its outline, in rad/s2.
TURN_STOP = 0.75 / 2 * 12
# One that slides ahead as well has less grip left for that: measured in MuJoCo at a friction of 0.1, it turned on by 20
# degrees from 40 degrees a second.
TURNS_ON_S = 0.5
RATE_TICKS = 2  # over which the turn rate is taken: that of one tick is mostly noise

# Sums since the start of the run, in degrees: what each side was told to turn the rover by itself (the left one
# clockwise, the right one back), what both were told to turn it either way, and what it has turned clockwise; how fast
# it turned before, and how far it went ahead. A plain tuple, because one is made 20 times a second.
Moment = tuple[float, float, float, float, float, float, float]


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
        self._turn_stop_deg_s2 = degrees(TURN_STOP * settings.gain_m_s2 / hypot(vehicle.length_m, vehicle.width_m))
        self._deg_s_per_duty = degrees(vehicle.max_speed_m_s / vehicle.track_m)
        self._left_deg_s = self._right_deg_s = 0.0
        self._left_deg = self._right_deg = self._either_deg = 0.0
        self._way = AHEAD
        self._window: deque[Moment] = deque()
        self._gained: deque[tuple[float, float]] = deque(maxlen=RATE_TICKS + 1)
        self._told: deque[tuple[float, int]] = deque()
        self._suspect: tuple[float, int] | None = None  # when to tell, and of which side
        self.condition = Condition.DRIVE_ASYMMETRY
        self.until_t_s = -inf

    def update(self, interval: Interval, gained_deg: float, ahead_m: float, *, trusted: bool) -> None:
        """Take in a tick: what the wheels were told since the last, and the heading and way gained since the start.

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
        if self._suspect is not None:
            self._confirm(t_s, self._suspect, interval.applied, trusted=trusted)
        rate_deg_s = self._rate_before_deg_s(t_s, gained_deg)
        window.append((t_s, self._left_deg, self._right_deg, self._either_deg, gained_deg, rate_deg_s, ahead_m))
        while t_s - window[0][0] > self._window_s:
            window.popleft()
        t_then_s, left_then_deg, right_then_deg, either_then_deg, gained_then_deg, _, _ = window[0]
        measured_deg = gained_deg - gained_then_deg
        still = -self._least_deg < measured_deg < self._least_deg
        if still and not self._told and way in (AHEAD, BACK):
            return  # as nearly always; a rover that is held turns no more than that
        left_deg, right_deg = self._left_deg - left_then_deg, self._right_deg - right_then_deg
        if way not in (AHEAD, BACK):
            self._check_sense(t_s, left_deg - right_deg, measured_deg, ahead_m)
        elif not still:
            self._compare(t_s, left_deg, right_deg, self._either_deg - either_then_deg, measured_deg)
        elif t_s - t_then_s + 2 * driven_s > self._window_s:
            self._clear_sides(left_deg, right_deg, measured_deg)

    def _confirm(self, t_s: float, suspect: tuple[float, int], applied: WheelCommand, *, trusted: bool) -> None:
        """Tell of the side under suspicion, once no anomaly has followed: a trunk that turns a rover soon holds it.

        Where hardly any side but that one was told to push, the anomaly may be that side's as well: that is told, but
        is never a fault, for a controller asks for that beside a trunk too.
        """
        at_s, side = suspect
        suspected, other = applied if side == LEFT else reversed(applied)
        alone = abs(other) < self._settings.immobilised_below * abs(suspected)
        if trusted and t_s < at_s:
            return
        self._suspect = None
        if trusted:
            self._tell(t_s, side, self._settings.drive_uneven_windows)
        elif alone:
            self._show(t_s, Condition.DRIVE_ASYMMETRY)

    def _rate_before_deg_s(self, t_s: float, gained_deg: float) -> float:
        """Return the turn rate that the body had before this tick."""
        gained = self._gained
        rate_deg_s = 0.0
        if len(gained) > RATE_TICKS:
            (first_s, first_deg), (last_s, last_deg) = gained[0], gained[-1]
            rate_deg_s = (last_deg - first_deg) / (last_s - first_s)
        gained.append((t_s, gained_deg))
        return rate_deg_s

    def _coasts_deg(self, way: float) -> float:
        """Return how far the body may turn on that way from the rate that it had before the window."""
        rate_deg_s = way * self._window[0][RATE]
        return max(0.0, rate_deg_s) * max(TURNS_ON_S, rate_deg_s / (2 * self._turn_stop_deg_s2))

    def _clear_sides(self, left_deg: float, right_deg: float, measured_deg: float) -> None:
        """Forget what was told of either side, if it would have shown in this window as well."""
        margin_deg = self._settings.drive_margin_deg
        if abs(measured_deg + right_deg) > margin_deg < abs(measured_deg - left_deg):
            self._told = deque(each for each in self._told if each[1] == REVERSED)

    def _compare(self, t_s: float, left_deg: float, right_deg: float, either_deg: float, measured_deg: float) -> None:
        """Look for a side that lags behind: if it is the left one, the rover turns left ahead, right in reverse."""
        settings, commanded_deg = self._settings, left_deg - right_deg
        excess_deg = measured_deg - commanded_deg
        if abs(excess_deg) <= settings.drive_margin_deg + settings.drive_margin_share * abs(commanded_deg):
            return
        way = copysign(1.0, excess_deg)
        coasted_deg = self._coasts_deg(way)
        that_way_deg = (either_deg + way * commanded_deg) / 2 + coasted_deg
        if way * measured_deg < that_way_deg + settings.drive_margin_deg / 2:
            return  # no more than it was told to turn that way: it was held, as by a tree or by the ground
        side, dead_deg = (LEFT, left_deg) if excess_deg * self._way < 0.0 else (RIGHT, right_deg)
        self._suspect = self._suspect or (t_s + settings.drive_confirm_s - 1e-6, side)
        if abs(excess_deg) - coasted_deg > settings.reversed_share * abs(dead_deg) + settings.reversed_margin_deg:
            self._tell(t_s, REVERSED, settings.reversed_turns)

    def _check_sense(self, t_s: float, commanded_deg: float, measured_deg: float, ahead_m: float) -> None:
        """Look for a turn on the spot that goes the other way, or straight on."""
        settings = self._settings
        way = 1.0 if self._way == CLOCKWISE else -1.0
        back_deg = settings.reversed_back_deg + self._coasts_deg(-way)
        if way * commanded_deg < settings.reversed_turn_deg:
            return
        suspected = any(what == REVERSED for _, what in self._told)
        straight = suspected and way * measured_deg < self._least_deg and self._goes_straight_on(ahead_m)
        if straight or way * measured_deg <= -back_deg:
            self._tell(t_s, REVERSED, settings.reversed_turns)

    def _goes_straight_on(self, ahead_m: float) -> bool:
        """Tell whether the wheels drive the body ahead or back: one that only coasts, or is shoved, gets slower.

        A body with one side in mud goes ahead as well, so that this alone raises no suspicion.
        """
        first_m, middle_m = self._window[0][AHEAD_M], self._window[len(self._window) // 2][AHEAD_M]
        early_m, late_m = middle_m - first_m, ahead_m - middle_m
        return abs(early_m + late_m) >= self._settings.reversed_straight_m and early_m * late_m >= early_m * early_m

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
        self._show(t_s, Condition.DRIVE_FAILED if failed else Condition.DRIVE_ASYMMETRY)

    def _show(self, t_s: float, condition: Condition) -> None:
        self.condition, self.until_t_s = condition, t_s + self._window_s
