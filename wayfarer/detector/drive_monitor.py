"""Detects a dead, weak or reversed side: compares the turn of the body with the wheel commands.

The turn is compared with what a healthy drive can do on any ground. Ground with much grip resists a turn, so the body
may turn by any part of what was commanded, or not at all. On slippery ground it may continue to turn for a while. No
ground turns it further than commanded, or the other way; a dead side does.

A trunk can also turn the body this way while it slides along it. So what was found of a side is cleared by either of
two observations: the body hardly turned in a window in which a dead side would have turned it; or it turned on the spot
about its middle, while with a dead side it turns about that side.
"""

from __future__ import annotations

from collections import deque
from math import degrees, hypot, inf, radians
from typing import Final, NamedTuple

from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Vehicle
from wayfarer.hal import WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import TickInterval

# What a window shows: the side that lags behind, or wheels that turn the wrong way.
LEFT: Final = -1
RIGHT: Final = 1
REVERSED: Final = 0
# What the rover is commanded to do during a window: drive ahead or back, or turn on the spot.
AHEAD: Final = 1
BACK: Final = -1
CLOCKWISE: Final = 2
ANTICLOCKWISE: Final = -2

# A friction f stops a turn with f g times this, divided by the diagonal of the body's outline, in rad/s2. Assumed: the
# wheels are about three quarters of the way from the middle of the body to its corners, and its weight is evenly spread
# over the outline.
TURN_STOP: Final = 0.75 / 2 * 12
# A body that also slides ahead has less grip left to stop its turn: measured in MuJoCo at a friction of 0.1, it
# continued to turn by 20 degrees from 40 degrees a second.
TURNS_ON_S: Final = 0.5
RATE_TICKS: Final = 2  # the turn rate is the mean over so many ticks: that of one tick is mostly noise


class DriveSample:
    """Cumulative sums at one tick, since the start of the run.

    ``left_deg`` is how far the commands of the left side alone turn the rover clockwise, ``right_deg`` how far those of
    the right side alone turn it anticlockwise; both include the lag of the body. ``clockwise_deg`` and
    ``anticlockwise_deg`` are how far the commands of both sides together turn it each way, without the lag.
    ``gained_deg`` is how far it has turned, clockwise positive; ``ahead_m`` how far it was seen to move ahead.
    """

    def __init__(
        self,
        t_s: float,
        left_deg: float,
        right_deg: float,
        clockwise_deg: float,
        anticlockwise_deg: float,
        gained_deg: float,
        ahead_m: float,
    ) -> None:
        self.t_s = t_s
        self.left_deg = left_deg
        self.right_deg = right_deg
        self.clockwise_deg = clockwise_deg
        self.anticlockwise_deg = anticlockwise_deg
        self.gained_deg = gained_deg
        self.ahead_m = ahead_m


class SuspectedSide(NamedTuple):
    """A suspected side: when to report it, which side it is, and whether the body hardly moved when it was noticed."""

    report_t_s: float
    side: int
    held: bool


class DriveMonitor:
    """Compares the heading gained with the turn commanded, over a window of driving or turning one way.

    ``condition`` is the latest condition found; it holds until ``until_t_s``.
    """

    def __init__(self, settings: DetectorSettings, vehicle: Vehicle) -> None:
        self._settings = settings
        self._window_s = settings.drive_window_s + 1e-6  # sums of periods are off by a rounding error
        self._lag_s = settings.drive_lag_s
        self._least_deg = min(settings.drive_margin_deg / 2, settings.reversed_back_deg)
        self._from_duty = 2 * settings.drive_from_m_s / vehicle.max_speed_m_s
        self._turn_stop_deg_s2 = degrees(TURN_STOP * settings.gain_m_s2 / hypot(vehicle.length_m, vehicle.width_m))
        self._deg_s_per_duty = degrees(vehicle.max_speed_m_s / vehicle.track_m)
        self._m_per_deg = radians(vehicle.track_m)
        self._left_deg_s = self._right_deg_s = 0.0
        self._left_deg = self._right_deg = self._clockwise_deg = self._anticlockwise_deg = 0.0  # see ``DriveSample``
        self._way = AHEAD
        self._window: deque[DriveSample] = deque()
        self._before: deque[DriveSample] = deque(maxlen=RATE_TICKS + 1)  # the last ones before the window
        self._reports: deque[tuple[float, int]] = deque()
        self._suspect: SuspectedSide | None = None
        self.condition = Condition.DRIVE_ASYMMETRY
        self.until_t_s = -inf

    def update(self, interval: TickInterval, gained_deg: float, ahead_m: float, *, trusted: bool) -> None:
        """Take in a tick: the wheel commands since the last tick, and heading and distance gained since the start.

        A tick is ``trusted`` unless the compass is in doubt or there is an anomaly. A tick that is not trusted ends the
        window.
        """
        t_s, driven_s, (left, right) = interval.t_s, interval.driven_s, interval.commanded
        self._add_commanded(driven_s, left, right)
        duty = left + right
        straight = abs(duty) >= self._from_duty
        if straight:
            way = AHEAD if duty > 0.0 else BACK
        elif left > right:
            way = CLOCKWISE
        else:
            way = ANTICLOCKWISE
        window = self._window
        if way != self._way or not trusted:
            self._way = way
            self._leave_window()
        if self._suspect is not None:
            self._confirm(t_s, self._suspect, interval.commanded, trusted=trusted)
        now = DriveSample(
            t_s, self._left_deg, self._right_deg, self._clockwise_deg, self._anticlockwise_deg, gained_deg, ahead_m
        )
        window.append(now)
        then = window[0]
        while t_s - then.t_s > self._window_s:
            self._before.append(window.popleft())
            then = window[0]
        still = abs(gained_deg - then.gained_deg) < self._least_deg
        if still and straight and not self._reports:
            return  # nearly every tick ends here; a rover that is held turns no more than that
        if not straight:
            self._check_sense(then, now)
        elif not still:
            self._compare(then, now)
        elif t_s - then.t_s + 2 * driven_s > self._window_s:
            self._clear_sides(then, now)

    def _add_commanded(self, driven_s: float, left: float, right: float) -> None:
        """Add the commands that the wheels obeyed for ``driven_s``."""
        share, deg_s_per_duty = driven_s / (driven_s + self._lag_s), self._deg_s_per_duty
        left_deg_s = self._left_deg_s = self._left_deg_s + (left * deg_s_per_duty - self._left_deg_s) * share
        right_deg_s = self._right_deg_s = self._right_deg_s + (right * deg_s_per_duty - self._right_deg_s) * share
        self._left_deg += left_deg_s * driven_s
        self._right_deg += right_deg_s * driven_s
        turn_deg = (left - right) * deg_s_per_duty * driven_s
        if turn_deg > 0.0:
            self._clockwise_deg += turn_deg
        else:
            self._anticlockwise_deg -= turn_deg

    def _confirm(self, t_s: float, suspect: SuspectedSide, applied: WheelCommand, *, trusted: bool) -> None:
        """Report the suspected side if no anomaly has followed: a trunk that turns a rover soon holds it.

        If almost only that side was commanded, the anomaly may be caused by that side. This is reported, but never as
        a fault, because the controller also commands this beside a trunk. A side that lagged while the body hardly
        moved is no fault either: on slippery ground, a trunk that holds a healthy rover can turn it.
        """
        at_s, side, held = suspect
        suspected, other = applied if side == LEFT else reversed(applied)
        alone = abs(other) < self._settings.immobilised_below * abs(suspected)
        if trusted and t_s < at_s:
            return
        self._suspect = None
        if trusted and not held:
            self._report(t_s, side, self._settings.drive_uneven_windows)
        elif trusted or alone:
            self._show(t_s, Condition.DRIVE_ASYMMETRY)

    def _leave_window(self) -> None:
        """Begin another window with the next tick."""
        self._before.extend(self._window)
        self._window.clear()

    def _rate_before_deg_s(self) -> float:
        """Return the turn rate that the body had just before the window, 0 where that is not known."""
        if len(self._before) <= RATE_TICKS:
            return 0.0
        first, last = self._before[0], self._before[-1]
        return (last.gained_deg - first.gained_deg) / (last.t_s - first.t_s)

    def _coasts_deg(self, then: DriveSample, now: DriveSample, way: float) -> float:
        """Return how far the body may continue to turn that way, because of its turn rate before the window.

        A body that gains or loses speed as fast as slippery ground allows has no grip left to stop its turn: it may
        continue to turn for the whole window.
        """
        rate_deg_s = way * self._rate_before_deg_s()
        if rate_deg_s <= 0.0:
            return 0.0
        early_m, late_m = self._halves_m(then, now)
        window_s = now.t_s - then.t_s
        slides = abs(late_m - early_m) >= self._settings.gain_m_s2 * (window_s / 2) ** 2
        turns_on_s = max(TURNS_ON_S, window_s if slides else 0.0, rate_deg_s / (2 * self._turn_stop_deg_s2))
        return rate_deg_s * turns_on_s

    def _clear_sides(self, then: DriveSample, now: DriveSample) -> None:
        """Forget what was found of both sides, if a dead side would have turned the body in this window."""
        margin_deg, measured_deg = self._settings.drive_margin_deg, now.gained_deg - then.gained_deg
        left_deg, right_deg = now.left_deg - then.left_deg, now.right_deg - then.right_deg
        if abs(measured_deg + right_deg) > margin_deg and abs(measured_deg - left_deg) > margin_deg:
            self._forget_sides()

    def _forget_sides(self) -> None:
        """Forget the reports of sides that lag; those of reversed wheels stay."""
        self._reports = deque(each for each in self._reports if each[1] == REVERSED)

    def _compare(self, then: DriveSample, now: DriveSample) -> None:
        """Look for a side that lags behind: with the left one, the rover turns left ahead, and right in reverse."""
        settings, measured_deg = self._settings, now.gained_deg - then.gained_deg
        left_deg, right_deg = now.left_deg - then.left_deg, now.right_deg - then.right_deg
        commanded_deg = left_deg - right_deg
        excess_deg = measured_deg - commanded_deg
        if abs(excess_deg) <= settings.drive_margin_deg + settings.drive_margin_share * abs(commanded_deg):
            return
        clockwise_deg = now.clockwise_deg - then.clockwise_deg
        anticlockwise_deg = now.anticlockwise_deg - then.anticlockwise_deg
        way, that_way_deg = (1.0, clockwise_deg) if excess_deg > 0.0 else (-1.0, anticlockwise_deg)
        coasted_deg = self._coasts_deg(then, now, way)
        beyond_deg = way * measured_deg - that_way_deg - coasted_deg
        if beyond_deg < settings.drive_margin_deg / 2:
            return  # it turned no further that way than commanded: a tree or the ground held it back
        side, dead_deg = (LEFT, left_deg) if excess_deg * self._way < 0.0 else (RIGHT, right_deg)
        if beyond_deg < settings.drive_margin_deg and self._both_push(now, side):
            return  # both sides push: it turned a little too far by chance, while the ground held it
        reversed_deg = settings.reversed_share * abs(dead_deg) + settings.reversed_margin_deg
        if abs(excess_deg) - coasted_deg > reversed_deg:
            self._report(now.t_s, REVERSED, settings.reversed_turns)
        held = self._held(then, now)
        if self._suspect is None or (self._suspect.held and not held):
            self._suspect = SuspectedSide(now.t_s + settings.drive_confirm_s - 1e-6, side, held)

    def _held(self, then: DriveSample, now: DriveSample) -> bool:
        """Return whether the body hardly moved, compared with the commands: what holds it may also turn it.

        One side alone drives it half as far as both. The answer is no if no motion was seen at all, because then the
        sensor may be blind.
        """
        commanded_m = (now.left_deg - then.left_deg + now.right_deg - then.right_deg) / 2 * self._m_per_deg
        moved_m = now.ahead_m - then.ahead_m
        return moved_m != 0.0 and self._way * moved_m < self._settings.immobilised_below * self._way * commanded_m

    def _both_push(self, now: DriveSample, side: int) -> bool:
        """Return whether the speed of the body is closer to that of both sides than to that of the other side alone.

        Only recent samples count, the second half of the window, because a side may have failed a moment ago. A motion
        sensor that does not see the direction cannot show this.
        """
        middle = self._window[len(self._window) // 2]
        left_deg, right_deg = now.left_deg - middle.left_deg, now.right_deg - middle.right_deg
        dead_deg, other_deg = (left_deg, right_deg) if side == LEFT else (right_deg, left_deg)
        between_m = (other_deg + dead_deg / 2) / 2 * self._m_per_deg
        return self._way * (now.ahead_m - middle.ahead_m) >= max(0.0, self._way * between_m)

    def _check_sense(self, then: DriveSample, now: DriveSample) -> None:
        """Look for a commanded turn on the spot in which the body turns the other way, or drives straight on."""
        settings = self._settings
        way = 1.0 if self._way == CLOCKWISE else -1.0
        commanded_deg = way * (now.left_deg - then.left_deg - now.right_deg + then.right_deg)
        if commanded_deg < settings.reversed_turn_deg:
            return
        measured_deg = way * (now.gained_deg - then.gained_deg)
        if measured_deg >= settings.drive_margin_deg / 2 and self._about_the_middle(then, now):
            self._forget_sides()
        back_deg = settings.reversed_back_deg + self._coasts_deg(then, now, -way)
        suspected = any(what == REVERSED for _, what in self._reports)
        straight = suspected and measured_deg < self._least_deg and self._goes_straight_on(then, now)
        if straight or measured_deg <= -back_deg:
            self._report(now.t_s, REVERSED, settings.reversed_turns)

    def _about_the_middle(self, then: DriveSample, now: DriveSample) -> bool:
        """Return whether the body was seen to turn about its middle.

        With a dead side it turns about that side, and its middle moves by half a track for each radian. The answer is
        no if no motion was seen at all, because then the sensor may be blind.
        """
        turned_m = (now.gained_deg - then.gained_deg) * self._m_per_deg
        return 0.0 < abs(now.ahead_m - then.ahead_m) < abs(turned_m) / 4

    def _goes_straight_on(self, then: DriveSample, now: DriveSample) -> bool:
        """Return whether the wheels drive the body ahead or back: a body that only coasts, or was pushed, gets slower.

        A body with one side in mud goes straight on as well, so this alone is no reason for a report.
        """
        early_m, late_m = self._halves_m(then, now)
        return abs(early_m + late_m) >= self._settings.reversed_straight_m and early_m * late_m >= early_m * early_m

    def _halves_m(self, then: DriveSample, now: DriveSample) -> tuple[float, float]:
        """Return how far the body was seen to move ahead in each half of the window."""
        middle = self._window[len(self._window) // 2]
        return middle.ahead_m - then.ahead_m, now.ahead_m - middle.ahead_m

    def _report(self, t_s: float, what: int, limit: int) -> None:
        """Note what a window shows; ``limit`` equal reports within ``drive_memory_s`` are a fault.

        One window gives one report of a kind: the next one counts after a window's length, or in a new window.
        """
        reports = self._reports
        while reports and t_s - reports[0][0] > self._settings.drive_memory_s:
            reports.popleft()
        alike = [when_s for when_s, each in reports if each == what]
        begins_s = self._window[0].t_s if self._window else t_s
        if alike and t_s - alike[-1] < self._window_s and begins_s <= alike[-1]:
            return
        reports.append((t_s, what))
        failed = len(alike) + 1 >= limit
        if failed:
            reports.clear()  # a person who re-arms the rover has looked at it
            self._leave_window()
        self._show(t_s, Condition.DRIVE_FAILED if failed else Condition.DRIVE_ASYMMETRY)

    def _show(self, t_s: float, condition: Condition) -> None:
        self.condition, self.until_t_s = condition, t_s + self._window_s
