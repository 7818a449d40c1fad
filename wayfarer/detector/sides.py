"""Watches what each side of the wheels contributes, and judges the self-test of a side that seems not to drive.

*Watching* only raises a suspicion. Ground may hold a turn back by any amount, so a body that turns less than commanded
shows nothing. No ground turns it further than commanded, or the other way; a dead, weak or reversed side does, and so
does a trunk that the body slides along. *The self-test* decides (``escape.ladder``): each side alone, ahead and back,
compared with the other one. Nothing is concluded without it.
"""

from __future__ import annotations

from collections import deque
from math import degrees, inf
from typing import Final

from wayfarer.detector.self_test import (
    BODY_LAG_S,
    CLEAR,
    PUSHES_FROM,
    Response,
    SelfTest,
    any_opposes,
)
from wayfarer.escape.api import SideGains, Vehicle
from wayfarer.hal import STOP
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import ROUNDING_S, TickInterval

# -- watching ------------------------------------------------------------------------------------------------------
# No source for these: in 0.8 s a dead side of the slowest shipped rover turns it by 40 degrees, while noise and unequal
# sides turn it by some 4 (one standard deviation). A false suspicion costs a self-test of 3 s, once in a while.
MEMORY_S: Final = 0.8
LEAST_DEG: Final = 12.0
LEAST_M: Final = 0.1
LEAST_SHARE: Final = 0.35  # of what one side alone turns or moves the body
# A flow sensor at another height than configured sees more than the wheels do. Measured: up to this, all is well.
FLOW_SCALE_MAX: Final = 1.6
# A trunk turns a body before it holds it. If an anomaly follows so soon, it was a trunk.
CONFIRM_S: Final = 0.5
# One side that obeys gives at most 1. Beyond this the other side adds to it, the wrong way.
REVERSED_SHARE: Final = 1.1
# No wheels turn a body further in a tick than full duty of both sides, plus this for noise (``escape.turn_control``).
STRANGE_DEG: Final = 10.0
# Steering that has no effect for so long: no curve of a manoeuvre lasts longer. A turn on the spot is judged by
# ``detector.turnable``. From no source.
UNTURNED_S: Final = 3.0
UNTURNED_SHARE: Final = 0.25

# -- judging the self-test: responses are shares of what ideal ground gives ----------------------------------------
RESPONDS: Final = 0.2  # a side that moves the body by less than this shows nothing: something may hold the body
WEAK_SHARE: Final = 0.4  # of the response of the other side; healthy sides differ by some 10 %
DEAD_SHARE: Final = 0.25  # below it a side is not used at all
# Tested again at another place, then after twice as long, up to 8 minutes: a trunk may have held one side, a blocked
# wheel may come free, and a healthy rover must not spend its time on tests. No source has these times.
AGAIN_S: Final = 20.0
AGAIN_MAX_S: Final = 480.0
UNDECIDED_AGAIN_S: Final = 10.0  # where the body was held: some metres further on, then after twice as long as well


class Excess:
    """How far the body goes beyond its commands, in one direction of motion: leaky sums over ``MEMORY_S``.

    Commands both ways are summed separately: a body may follow the one and not the other.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        # Sums of the commands each way at each of the latest ticks, the newest last.
        self._positives, self._negatives = deque([0.0]), deque([0.0])
        self._observed = 0.0

    def update(self, keep: float, commanded: float, observed: float, late_ticks: int = 0) -> float:
        """Take in a tick, in any unit; return how far what was observed lies outside of what was commanded.

        Whatever was commanded up to ``late_ticks`` ago counts as commanded now: a sensor may show so late what it did.
        """
        positives, negatives = self._positives, self._negatives
        positives.append((positives[-1] + max(commanded, 0.0)) * keep)
        negatives.append((negatives[-1] - min(commanded, 0.0)) * keep)
        while len(positives) > late_ticks + 1:
            positives.popleft()
            negatives.popleft()
        self._observed = total = (self._observed + observed) * keep
        return max(total - max(positives), -total - max(negatives))

    def follows(self, share: float, least: float) -> bool:
        """Return whether the body has done this share of its commands, or the commands were less than ``least``."""
        commanded = abs(self._positives[-1] - self._negatives[-1])
        return commanded < least or abs(self._observed) >= share * commanded


class DriveWatch:
    """Compares turn and motion of the body with the commands; ``suspects`` is whether a side seems not to obey.

    ``late_ticks`` is how late the compass shows turns, as the latest self-test has found.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._deg_s_per_duty = degrees(vehicle.max_speed_m_s / vehicle.track_m)  # of one side alone
        self._m_s_per_duty = vehicle.max_speed_m_s / 2.0
        self.late_ticks = 0
        self._left = self._right = 0.0
        self._turn, self._motion = Excess(), Excess()
        self.reset()

    def reset(self) -> None:
        """Forget: nothing is known of the time before now."""
        self.suspects = False
        self._confirm_at_s = inf
        self._unturned_s = 0.0  # for which steering has had no effect
        self._one_side = 0.0  # duty of the stronger side, summed in the same way
        self._turn.clear()
        self._motion.clear()

    def update(self, interval: TickInterval, turned_deg: float, ahead_m: float, *, trusted: bool) -> None:
        """Take in a tick: the commands before it, and what the body did since the last one.

        A tick is ``trusted`` unless the heading is in doubt or there is an anomaly; others are forgotten.
        """
        driven_s, (left, right) = interval.driven_s, interval.commanded
        share = driven_s / (driven_s + BODY_LAG_S)
        left = self._left = self._left + (left - self._left) * share
        right = self._right = self._right + (right - self._right) * share
        stronger, most_deg = max(abs(left), abs(right)), 2.0 * self._deg_s_per_duty * interval.dt_s + STRANGE_DEG
        stands = interval.commanded == STOP or stronger < PUSHES_FROM
        if not trusted or stands or abs(turned_deg) > most_deg:
            self.reset()  # a person may turn or push a rover that stands
            return
        keep = MEMORY_S / (MEMORY_S + interval.dt_s)
        turn_per, motion_per = self._deg_s_per_duty, self._m_s_per_duty
        self._one_side = (self._one_side + stronger * driven_s) * keep
        turn_deg = self._turn.update(keep, (left - right) * turn_per * driven_s, turned_deg, self.late_ticks)
        most_m = FLOW_SCALE_MAX * (left + right) * motion_per * driven_s
        motion_m = self._motion.update(keep, most_m, ahead_m)
        if turn_deg > LEAST_DEG:
            self._suspect(interval.t_s, turn_deg / turn_per, LEAST_DEG / turn_per)
        if motion_m > LEAST_M:
            self._suspect(interval.t_s, motion_m / motion_per, LEAST_M / motion_per)
        steers = abs(left + right) >= abs(left - right) / 2.0 and not self._turn.follows(UNTURNED_SHARE, LEAST_DEG)
        self._unturned_s = self._unturned_s + driven_s if steers else 0.0
        if interval.t_s >= self._confirm_at_s or self._unturned_s >= UNTURNED_S:
            self.suspects = True

    def _suspect(self, t_s: float, excess: float, noise: float) -> None:
        """Suspect a side for this excess, in seconds of its full duty: at once, or if no anomaly follows."""
        if excess > REVERSED_SHARE * self._one_side + noise:
            self._confirm_at_s = t_s
        elif excess > LEAST_SHARE * self._one_side and self._confirm_at_s == inf:
            self._confirm_at_s = t_s + CONFIRM_S - ROUNDING_S


class SideMonitor:
    """Holds what is known of both sides.

    ``gains`` is None while both sides count as healthy. ``conditions`` are those of this tick. The controller asks
    ``wants_test``, calls ``begin_test``, drives the pulses of ``escape.ladder``, and calls ``end_test``.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._watch = DriveWatch(vehicle)
        self._deg_s_per_duty = degrees(vehicle.max_speed_m_s / vehicle.track_m)
        self._m_s_per_duty = vehicle.max_speed_m_s / 2.0
        self.reset()

    def reset(self) -> None:
        """Believe both sides: a person has armed the rover and has looked at it."""
        self._watch.reset()
        self._watch.late_ticks = 0
        self._test: SelfTest | None = None
        self._unturned_s = inf  # since the last command to turn
        self._spoilt = False  # whether the heading was in doubt during the test
        self._not_before_s = -inf
        self._again_s, self._undecided_again_s = AGAIN_S, UNDECIDED_AGAIN_S
        self._reversed = self._doubtful = False
        self.gains: SideGains | None = None

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """What is wrong with the sides now."""
        if self._reversed:
            return (Condition.DRIVE_REVERSED,)
        if self.gains is not None:
            return (Condition.DRIVE_WEAK,)
        return (Condition.DRIVE_SUSPECTED,) if self._watch.suspects else ()

    def wants_test(self, t_s: float) -> bool:
        """Return whether a self-test is due. Where the heading is in doubt it would show nothing."""
        return (self._watch.suspects or self.gains is not None) and t_s >= self._not_before_s and not self._doubtful

    def update(
        self, interval: TickInterval, turned_deg: float, ahead_m: float, *, trusted: bool, doubtful: bool
    ) -> None:
        """Take in a tick: the commands before it, how far the body turned and was seen to move ahead since then.

        ``trusted`` is whether neither an anomaly nor a doubt about the heading is there, ``doubtful`` the latter alone.
        """
        self._doubtful = doubtful
        left, right = interval.commanded
        self._unturned_s = self._unturned_s + interval.dt_s if abs(left - right) < PUSHES_FROM else 0.0
        if self._test is not None:
            self._spoilt |= doubtful  # a reckoned heading always turns as commanded
            self._test.add(interval, turned_deg, ahead_m)
        elif self.gains is None and not self._watch.suspects:
            self._watch.update(interval, turned_deg, ahead_m, trusted=trusted)
            if self._watch.suspects and interval.t_s < self._not_before_s:
                self._watch.reset()  # tested a moment ago, and found healthy

    def suspect(self, t_s: float) -> None:
        """Suspect a side for another reason: turns that fail, or a body that is far slower than commanded."""
        if self._test is None and t_s >= self._not_before_s:
            self._watch.suspects = True

    def begin_test(self) -> None:
        """Begin to judge the pulses that follow."""
        self._test, self._spoilt = SelfTest(self._unturned_s), False

    def end_test(self, t_s: float) -> bool:
        """Judge the pulses; return whether they decided anything, or the body was held."""
        assert self._test is not None
        left, right = self._test.responses(self._deg_s_per_duty, self._m_s_per_duty)
        if max(abs(left.turned), abs(right.turned)) >= CLEAR and not self._spoilt:
            self._watch.late_ticks = self._test.lag_ticks
        self._test = None
        self._watch.reset()
        if any_opposes(left, right) and not self._spoilt:
            self._reversed = True
            return True
        weak = min(left.strength, right.strength) < WEAK_SHARE * max(left.strength, right.strength)
        shows = _shows_weakness(left, right) if weak else max(left.strength, right.strength) >= RESPONDS
        if self._spoilt or not shows:
            self._not_before_s = t_s + self._undecided_again_s
            self._undecided_again_s = min(2.0 * self._undecided_again_s, AGAIN_MAX_S)
            return False
        self._undecided_again_s = UNDECIDED_AGAIN_S
        self._not_before_s = t_s + self._again_s
        self._again_s = min(2.0 * self._again_s, AGAIN_MAX_S)
        best = max(left.strength, right.strength)
        self.gains = SideGains(_gain(left.strength / best), _gain(right.strength / best)) if weak else None
        return True


def _shows_weakness(left: Response, right: Response) -> bool:
    """Return whether the weaker side is weak, and not the body wedged: then the better one moves it both ways."""
    weaker, better = (left, right) if left.strength < right.strength else (right, left)
    moves = better.strength >= CLEAR and better.poorer >= RESPONDS and better.poorer * WEAK_SHARE > weaker.strength
    return moves and (weaker.counts or better.moved >= CLEAR)


def _gain(share: float) -> float:
    """Return the gain of a side from its share of the response of the better one."""
    return share if share >= DEAD_SHARE else 0.0
