"""Compensates the ground's slope in the duty of both sides, so that a leg uphill has the commanded speed. Pure.

These rovers have no speed loop: a slope takes up a share of the duty. Uphill at 0.3 of full duty a rover crawls, or
rolls back; downhill it is too fast. The share is ``load * sin(pitch)``: ``load`` is the rover's weight over the push of
its motors at full duty. It is learnt while the body is seen to move. The pitch is that of the *ground*
(``detector.ground_slope``), so a body that a trunk holds or lifts gets no more duty for it, and a stall stays one. On
ground that counts as level nothing is added.
"""

from __future__ import annotations

from math import radians, sin
from typing import Final

from wayfarer.clamp import clamp
from wayfarer.escape.api import Vehicle
from wayfarer.hal import STOP, MotionReading, WheelCommand
from wayfarer.safety.tick_interval import TickInterval

# ForestRover's is 0.86 if the torque in the paper is that of stall, and 0.29 if it is the rated one, as of a third of
# stall. The first guess is between them. The most is from no source: it is that of a body that slides in a turn.
LOAD: Final = 0.6
LOAD_MAX: Final = 2.0
# Driven so far, the estimate has taken over 63 % of a change; a start is left out, because a body follows its wheels
# with a lag. From no source.
LEARN_M: Final = 0.5
STEADY_S: Final = 0.3
# A body on a flatter leg shows too little of the load.
LEARN_FROM_DEG: Final = 4.0
# Downhill at least this share of the commanded duty is kept: a load that is learnt too high must not stop the rover.
DOWNHILL_SHARE: Final = 0.5


class Load:
    """A learnt load: ``value`` is the duty that gravity takes up, for a sine of the slope of 1."""

    def __init__(self) -> None:
        self.value = LOAD

    def learn(self, missed: float, rise: float, moved_m: float) -> None:
        """Take in a reading.

        Args:
            missed: by how much the body was slower ahead than expected, as a share of the speed at full duty.
            rise: the sine of the slope ahead.
            moved_m: how far the body moved.
        """
        self.value = clamp(self.value + missed / rise * moved_m / (LEARN_M + moved_m), 0.0, LOAD_MAX)


class GradeCompensation:
    """Adds the duty that the slope takes up.

    Call ``update`` once a tick, ``compensate`` for a decision of the algorithm, then ``level`` for what was applied.
    Turns on the spot have a separate load: wheels that slip sideways push less against the slope.

    Args:
        vehicle: gives the ground speed at full duty.
        quality_min: the lowest quality of a motion reading that is used, 0 to 1.
    """

    def __init__(self, vehicle: Vehicle, quality_min: float) -> None:
        self._max_speed_m_s = vehicle.max_speed_m_s
        self._quality_min = quality_min
        self._drives, self._pivots = Load(), Load()
        self._rise = 0.0
        self._added = 0.0  # duty that this decision got against the slope
        self._uncompensated = 0.0  # what it lacks for all of the slope: positive downhill, where the slope drives
        self._way = 0  # 1 ahead, -1 back, 0 a turn on the spot
        self._forward_m = self._steady_s = self._read_s = 0.0

    def update(self, interval: TickInterval, motion: MotionReading | None, pitch_deg: float, *, free: bool) -> None:
        """Take in a tick.

        Args:
            interval: the wheel commands before it, as ``level`` gave them.
            motion: what may be believed of the motion sensor's new reading, None where there is none.
            pitch_deg: the ground's slope ahead, positive uphill; 0 where it is level or not known.
            free: whether the body moves, and nothing seems to hold it.
        """
        uncompensated, self._added, self._uncompensated = self._uncompensated, 0.0, 0.0
        self._rise = sin(radians(pitch_deg)) if pitch_deg else 0.0
        left, right = interval.commanded
        way = 0 if left * right < 0.0 else 1 if left + right > 0.0 else -1
        self._steady_s = self._steady_s + interval.driven_s if way == self._way and free else 0.0
        self._way = way
        self._forward_m += interval.forward_m + uncompensated * self._max_speed_m_s * interval.driven_s
        self._read_s += interval.driven_s
        if motion is None:
            return
        missed_m, driven_s = self._forward_m - motion.forward_m, self._read_s
        self._forward_m = self._read_s = 0.0
        if self._steady_s >= STEADY_S and abs(pitch_deg) >= LEARN_FROM_DEG and motion.quality >= self._quality_min:
            moved_m = abs(motion.forward_m)
            missed = missed_m / (driven_s * self._max_speed_m_s)
            self._load(left, right).learn(missed, self._rise, moved_m)

    def compensate(self, wheels: WheelCommand) -> WheelCommand:
        """Return the duties that drive the body on this slope as ``wheels`` would on level ground; turning comes first.

        A pivot is held in its place. A stop stays a stop.
        """
        if not self._rise or wheels == STOP:
            return wheels
        left, right = wheels
        ahead, turn, slope = (left + right) / 2.0, (left - right) / 2.0, self._load(left, right).value * self._rise
        added = slope
        if ahead * slope < 0.0:
            most = (1.0 - DOWNHILL_SHARE) * abs(ahead)
            added = clamp(slope, -most, most)
        room = max(1.0 - abs(turn), abs(ahead))
        driven = clamp(ahead + added, -room, room)
        self._added = driven - ahead
        self._uncompensated = self._added - slope
        return WheelCommand(driven + turn, driven - turn)

    def _load(self, left: float, right: float) -> Load:
        return self._pivots if left * right < 0.0 else self._drives

    def level(self, applied: WheelCommand) -> WheelCommand:
        """Return the duties that would drive the body on level ground as ``applied`` does on this slope."""
        if not self._added or applied == STOP:
            return applied
        return WheelCommand(applied.left - self._added, applied.right - self._added)
