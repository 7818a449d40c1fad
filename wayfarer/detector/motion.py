"""Checks the readings of the motion sensor and compares them with the wheel commands: stuck, running away, or blind."""

from __future__ import annotations

from math import hypot, radians
from typing import Final

from wayfarer.detector.runaway import RunawayMonitor
from wayfarer.detector.settings import DetectorSettings
from wayfarer.detector.sight import ReadingDoubt, ZeroDoubt
from wayfarer.detector.stall import StallMonitor
from wayfarer.detector.steering import SteeringMonitor
from wayfarer.escape.api import Vehicle
from wayfarer.hal import MotionReading
from wayfarer.safety.conditions import BLIND, Condition
from wayfarer.safety.tick_interval import TickInterval

# A reading counts for at most this share of the commanded distance of this or the previous reading (a rover may roll
# on). A tenth is for noise.
MOST_SHARE: Final = 1.1
# Of ``blind_stride_m``, for a rover that knows neither motion nor tilt, and for one whose motion sensor lies: at least
# two body lengths, so that it gets around a trunk. From no source.
SHORT_SHARE: Final = 0.3


class MotionMonitor:
    """Passes plausible readings to ``stall`` and ``runaway``, and measures how long there was none.

    ``watched`` says whether silence is a condition; ``moves`` is whether the newest reading shows that the rover
    moves. ``reading`` is what may be believed of this tick's reading: its quality is 0 where its zeros are doubted
    (``detector.sight``), and while the sensor is silent, because motion that nobody saw is unknown, not zero. A
    sensor that sees no direction counts as seeing that of the wheels, here and for all who take ``reading``.
    ``stride_over`` says that a rover that sees nothing has driven ahead for ``blind_stride_m``, and may have been
    stuck for all of it, or that something holds it, because its heading does not answer steering.
    """

    def __init__(self, settings: DetectorSettings, vehicle: Vehicle, *, watched: bool) -> None:
        self._settings = settings
        self._half_speed_m_s = vehicle.max_speed_m_s / 2
        self._m_per_deg = radians(vehicle.track_m / 2)
        self._watched = watched
        self._stale_s = settings.motion_stale_s
        self._quality_min = settings.quality_min
        self._seen_from_m_s = settings.immobilised_from_m_s
        self._speed_max_m_s = settings.motion_speed_max_m_s
        self.stall = StallMonitor(settings)
        self.runaway = RunawayMonitor(settings, vehicle.max_speed_m_s)
        self._steering = SteeringMonitor(vehicle)
        self._zeros, self._readings = ZeroDoubt(), ReadingDoubt()
        self._stride_m = settings.blind_stride_m
        self._blind_m = 0.0
        self.moves = self.stride_over = self._lies = False
        self.reading: MotionReading | None = None
        self._commanded_m = self._before_m = self._undriven_s = 0.0
        # Since the last reading: the mean distance commanded of the sides, ahead and back both positive; how much
        # further the left side was commanded than the mean of both; how far the body turned.
        self._pushed_m = self._led_m = self._turned_deg = 0.0
        self._driven_t_s = self._spoke_t_s = self._moved_t_s = 0.0

    def start(self, t_s: float) -> None:
        """Begin all ages now."""
        self._driven_t_s = self._spoke_t_s = self._moved_t_s = t_s

    def update(
        self, interval: TickInterval, turned_deg: float, reading: MotionReading | None, conditions: list[Condition]
    ) -> None:
        """Take in a tick.

        Args:
            interval: the wheel commands since the previous one.
            turned_deg: how far the rover has turned since then.
            reading: what the sensor says, if anything.
            conditions: takes what is found.
        """
        t_s, driven_s, (left, right) = interval.t_s, interval.driven_s, interval.commanded
        self._commanded_m += interval.forward_m
        self._pushed_m += (abs(left) + abs(right)) * self._half_speed_m_s * driven_s
        self._led_m += (left - right) * self._half_speed_m_s * driven_s
        self._turned_deg += turned_deg
        self._undriven_s += interval.dt_s - driven_s
        if left or right:
            self._driven_t_s = t_s
        self._zeros.update(interval, turned_deg, reading)
        if reading is not None:
            if not reading.signed and self._commanded_m < 0.0:
                reading = reading._replace(forward_m=-reading.forward_m)
            if reading.quality >= self._quality_min:
                self._lies = self._readings.doubts(reading, self._commanded_m)
            if self._lies or self._zeros.doubts:
                reading = reading._replace(quality=0.0)
        self.reading = reading
        if reading is not None:
            self._take(t_s, reading, conditions)
        if t_s - self._moved_t_s > self._stale_s:
            self._check_ages(t_s, conditions)
        self._steering.update(interval, turned_deg, moves=self.moves)
        self._stride(interval.forward_m, conditions)
        if self.runaway.found:
            conditions.append(Condition.RUNAWAY)

    def _stride(self, forward_m: float, conditions: list[Condition]) -> None:
        """Add what was commanded ahead; only motion that is seen begins it again, a few sure zeros do not."""
        self.stride_over = False
        if self.moves:
            self._blind_m = 0.0
        elif self._watched and forward_m > 0.0:
            self._blind_m += forward_m
            share = SHORT_SHARE if self._lies or Condition.HEADING_RECKONED in conditions else 1.0
            held = self._steering.unanswered and not BLIND.isdisjoint(conditions)
            if held or self._blind_m >= share * self._stride_m:
                self._blind_m = 0.0
                self._steering.begin()
                self.stride_over = True

    def _take(self, t_s: float, reading: MotionReading, conditions: list[Condition]) -> None:
        read_t_s, forward_m, right_m, quality, signed = reading
        if not self._spoke_t_s < read_t_s <= t_s:
            self.reading = None
            return  # an impossible time, or not later than the last reading or the start of the run
        dt_s, self._spoke_t_s = read_t_s - self._spoke_t_s, read_t_s
        commanded_m, self._commanded_m = self._commanded_m, 0.0
        distance_m, before_m = abs(commanded_m), self._before_m
        self._before_m = distance_m
        # A reading may be older than the gap that the tick saw: then nothing is known to have been driven.
        driven_s = dt_s - self._undriven_s if self._undriven_s < dt_s else 0.0
        self._undriven_s = 0.0
        turned_deg = self._turned_deg
        straight = distance_m / hypot(self._pushed_m, turned_deg * self._m_per_deg) if commanded_m else 1.0
        if abs(self._led_m - turned_deg * self._m_per_deg) > abs(commanded_m - forward_m):
            straight = 0.0  # one side's wheels slip ahead, the other's back: their friction cancels out
        self._pushed_m = self._led_m = self._turned_deg = 0.0
        limit_m = self._speed_max_m_s * dt_s
        can_be = abs(forward_m) <= limit_m and abs(right_m) <= limit_m and 0.0 <= quality <= 1.0
        known = can_be and quality >= self._quality_min
        # No reading counts for much more than what was driven, so that single wild readings cannot hide a stall.
        counted_m = forward_m if known else None
        if known and commanded_m:
            most_m = MOST_SHARE * (distance_m if distance_m > before_m else before_m)
            counted_m = most_m if forward_m > most_m else -most_m if forward_m < -most_m else forward_m
        slid_m = right_m if known and abs(right_m) >= self._seen_from_m_s * dt_s else 0.0
        self.stall.add(driven_s, commanded_m, counted_m, turned_deg=turned_deg, straight=straight, slid_m=slid_m)
        if not can_be:
            self.reading = reading._replace(forward_m=0.0, right_m=0.0, quality=0.0)
            conditions.append(Condition.MOTION_IMPLAUSIBLE)
        if not known:
            self.moves = False
            self.runaway.clear()
            return
        self._moved_t_s = read_t_s
        self.moves = abs(forward_m) >= self._seen_from_m_s * dt_s
        stood_s = read_t_s - self._driven_t_s
        if stood_s > 0.0 or self.runaway.found:
            self.runaway.add(dt_s, stood_s, forward_m, signed=signed)

    def _check_ages(self, t_s: float, conditions: list[Condition]) -> None:
        settings = self._settings
        silent_s, unknown_s = t_s - self._spoke_t_s, t_s - self._moved_t_s
        if silent_s > settings.motion_stale_s:
            self.moves = False
            self.stall.clear()
            self.runaway.clear()
            self.reading = MotionReading(t_s, 0.0, 0.0, 0.0)
            gone = silent_s > settings.motion_lost_s
            found = Condition.MOTION_GONE if gone else Condition.MOTION_STALE
        elif unknown_s > settings.motion_lost_s:
            found = Condition.MOTION_LOST
        elif unknown_s > settings.motion_unknown_s:
            found = Condition.MOTION_UNKNOWN
        else:
            return
        if self._watched:
            conditions.append(found)
