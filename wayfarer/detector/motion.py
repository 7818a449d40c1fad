"""Checks the readings of the motion sensor and compares them with the wheel commands: stuck, running away, or blind."""

from __future__ import annotations

from math import hypot, inf, radians
from typing import Final

from wayfarer.detector.runaway import RunawayMonitor
from wayfarer.detector.settings import DetectorSettings
from wayfarer.detector.stall import StallMonitor
from wayfarer.detector.turning import SteeringMonitor
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import MotionReading
from wayfarer.safety.conditions import BLIND, Condition
from wayfarer.safety.tick_interval import TickInterval

# A reading counts for at most this share of the commanded distance of this or the previous reading (a rover may roll
# on). A tenth is for noise.
MOST_SHARE: Final = 1.1
# Of ``blind_stride_m``, for a rover that knows neither motion nor tilt, and for one whose motion sensor lies: at least
# two body lengths, so that it gets around a trunk. Chosen by us.
SHORT_SHARE: Final = 0.3


class MotionMonitor:
    """Passes plausible readings to ``stall`` and ``runaway``, and measures how long there was none.

    ``watched`` says whether silence is a condition; ``moves`` is whether the newest reading shows that the rover
    moves. ``reading`` is what may be believed of this tick's reading: its quality is 0 where its zeros are doubted
    (see below), and while the sensor is silent, because motion that nobody saw is unknown, not zero. A
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
            found = Condition.MOTION_STALE
        elif unknown_s > settings.motion_unknown_s:
            found = Condition.MOTION_UNKNOWN
        else:
            return
        if self._watched:
            conditions.append(found)


# -- what was covered --------------------------------------------------------------------------------------------------

# No rover goes so far from one reading to the next: after a long silence a sensor may add up what it did not see.
READING_MAX_M: Final = 1.0


class Odometer:
    """Adds up the distance covered, ``covered_m``; driving forwards and backwards both increase it.

    Only what was commanded counts as covered: that is what an algorithm asks. The *displacement* that ``update``
    returns is for dead reckoning, and has all that was seen: a body on a slope slides while it turns, or while its
    wheels push it uphill.

    Readings come less often than ticks. Between two readings the rover is assumed to cover the same share of the
    commanded distance as at the latest reading. Without a sensor that share is 1. What was assumed too far, as of a
    body that stalls, is subtracted from the next readings, until the direction changes.

    Args:
        quality_min: the lowest quality of a reading that is used, 0 to 1.
    """

    def __init__(self, quality_min: float) -> None:
        self._quality_min = quality_min
        self.covered_m = 0.0
        self._read_m = self._commanded_m = self._commanded_before_m = 0.0
        self._share = 1.0
        self._ahead = True
        self._assumed_m = 0.0  # displacement ahead since the last reading

    def update(self, interval: TickInterval, motion: MotionReading | None) -> tuple[float, float]:
        """Add a tick: the commands since the last one, and what the sensor saw since its last reading.

        Returns the displacement since the last tick, metres ahead and to the right. Between two readings it is assumed
        as well; the next reading corrects that.
        """
        if interval.forward_m and (interval.forward_m > 0.0) is not self._ahead:
            self._ahead = not self._ahead
            # Before a body was seen to stand it was assumed to go on. That must not be subtracted from the way back.
            self._read_m = self.covered_m - self._share * self._commanded_m
        self._commanded_m += abs(interval.forward_m)
        if motion is not None:
            self._take(motion)
        before_m = self.covered_m
        self.covered_m = max(self._read_m + self._share * self._commanded_m, before_m)
        ahead_m = self.covered_m - before_m if interval.forward_m >= 0.0 else before_m - self.covered_m
        if motion is None:
            self._assumed_m += ahead_m
            return ahead_m, 0.0
        assumed_m, self._assumed_m = self._assumed_m, 0.0
        known = motion.signed and self._quality_min <= motion.quality
        if known and max(abs(motion.forward_m), abs(motion.right_m)) <= READING_MAX_M:
            return motion.forward_m - assumed_m, motion.right_m
        return ahead_m, 0.0

    def _take(self, motion: MotionReading) -> None:
        commanded_m, before_m = self._commanded_m, self._commanded_before_m
        self._commanded_m, self._commanded_before_m = 0.0, commanded_m
        moved_m = commanded_m
        if self._quality_min <= motion.quality <= 1.0:  # written so that NaN counts as driven
            most_m = MOST_SHARE * (commanded_m if commanded_m > before_m else before_m)
            seen_m = abs(motion.forward_m)
            moved_m = seen_m if seen_m < most_m else most_m
        self._read_m += moved_m
        self._share = moved_m / commanded_m if moved_m < commanded_m else 1.0


# -- readings that lie -------------------------------------------------------------------------------------------------

# Doubts a motion sensor whose readings cannot be true: a doubted reading counts as unknown.
#
# * **Zeros on a body that moves.** Below a knee of brightness or texture the PMW3901 family reports exact zeros, often
#   with a quality above every useful minimum (PX4 issues 28632 and 28648). Its readings alone cannot tell that from a
#   body that a trunk holds. What the wheels do can: a body that is held ahead and behind cannot turn on the spot. One
#   that did turn, and was driven ahead and back before, has moved, and its sensor has seen nothing of it.
# * **Readings that repeat to the last digit.** A sensor that sees ground that moves has noise on every reading.
# * **Readings that start and stop.** A body that is driven one way does not stand in every second reading. Fewer zeros
#   than that are frames that the sensor lost (585 of 1,331 in PX4 issue 28632), and the sum over a window is right.

# Driven so far each way, a free body moves by more than a sensor could overlook: twice what counts as seen in a stall.
DRIVEN_M: Final = 0.1
# Turned so far on the spot: as much as shows that a body can turn (``detector.turning``).
TURNED_DEG: Final = 9.0
# So many equal readings in a row are no chance: at 5 mm a reading, a PMW3901's noise of 2 counts and more repeats one
# reading in five.
REPEATS: Final = 8
COUNTS_FROM_M: Final = 0.005
# A reading counts as standing below the one share of what was commanded, and as moving above the other. A body that
# met something and came free again stopped once, or twice; one that stops each second, for longer than a stall needs to
# be found, did not. Half of the latest readings must be zeros. Chosen by us.
STANDS_SHARE: Final = 0.1
MOVES_SHARE: Final = 0.3
STOPS_EACH_S: Final = 1.0
STOPS_FOR_S: Final = 2.3
LATEST: Final = 12


class ZeroDoubt:
    """Says whether exact zeros are no longer believed; the first other reading ends the doubt."""

    def __init__(self) -> None:
        self._ahead_m = self._back_m = self._turned_deg = 0.0
        self.doubts = False

    def update(self, interval: TickInterval, turned_deg: float, reading: MotionReading | None) -> None:
        """Take in a tick: the commands before it, how far the body turned meanwhile, and a reading, if there is one."""
        if reading is not None and (reading.forward_m != 0.0 or reading.right_m != 0.0):
            self._ahead_m = self._back_m = self._turned_deg = 0.0
            self.doubts = False
            return
        left, right = interval.commanded
        if left * right < 0.0:
            self._turn(turned_deg)
        elif interval.forward_m > 0.0:
            self._ahead_m += interval.forward_m
        else:
            self._back_m -= interval.forward_m

    def _turn(self, turned_deg: float) -> None:
        """Add up turns that follow driving both ways; a turn that is taken back is still a turn."""
        if self._ahead_m >= DRIVEN_M and self._back_m >= DRIVEN_M:
            self._turned_deg += abs(turned_deg)
            self.doubts = self._turned_deg >= TURNED_DEG


class ReadingDoubt:
    """Says whether readings repeat, or start and stop, as no body does; other readings end the doubt."""

    def __init__(self) -> None:
        self._last_m = self._last_right_m = 0.0
        self._repeats = 0
        self._moved, self._ahead = False, True
        self._stood = 0  # a bit for each of the latest readings, the newest lowest: 1 stood
        self._stops_since_s = self._stopped_s = -inf

    def doubts(self, reading: MotionReading, commanded_m: float) -> bool:
        """Take in a reading, and the distance commanded for it, negative in reverse; return whether it is doubted."""
        t_s, forward_m, right_m, _, _ = reading
        if forward_m != self._last_m or right_m != self._last_right_m or abs(forward_m) < COUNTS_FROM_M:
            self._repeats = 0
        elif commanded_m:
            self._repeats += 1  # wheels that stand must not begin a doubt: motion is a runaway then
        self._last_m, self._last_right_m = forward_m, right_m
        if (commanded_m > 0.0) is not self._ahead:
            self._ahead, self._stopped_s = not self._ahead, -inf
        if abs(commanded_m) >= COUNTS_FROM_M:
            self._count(t_s, abs(forward_m / commanded_m))
        stutters = t_s - self._stopped_s <= STOPS_EACH_S and t_s - self._stops_since_s >= STOPS_FOR_S
        return self._repeats >= REPEATS or (stutters and 2 * self._stood.bit_count() >= LATEST)

    def _count(self, t_s: float, share: float) -> None:
        """Count a reading, as a share of what was commanded for it, as one of a body that stands, or moves."""
        stands = share < STANDS_SHARE
        self._stood = (self._stood << 1 | stands) & ((1 << LATEST) - 1)
        if share >= MOVES_SHARE:
            self._moved = True
        elif self._moved and stands:
            self._moved = False
            if t_s - self._stopped_s > STOPS_EACH_S:
                self._stops_since_s = t_s
            self._stopped_s = t_s
