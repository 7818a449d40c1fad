"""Checks the readings of the motion sensor and compares them with the wheel commands: stuck, running away, or blind."""

from __future__ import annotations

from collections import deque
from math import copysign, inf, radians, sin
from typing import Final

from wayfarer.detector.ground import LOAD_MAX
from wayfarer.detector.response import StallMonitor, SteeringMonitor
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import MotionReading
from wayfarer.safety.conditions import BLIND, Condition
from wayfarer.safety.tick_interval import ROUNDING_S, Moved, ReadingInterval, TickInterval

# Of ``blind_stride_m``, for a rover that knows neither motion nor tilt, and for one whose motion sensor lies: at least
# two body lengths, so that it gets around a trunk. Chosen by us.
SHORT_SHARE: Final = 0.3
# A sensor that answers but sees nothing for so long: the motion of the rover is unknown (fault catalogue, fault 15).
UNKNOWN_S: Final = 0.9


class MotionMonitor(ReadingInterval):
    """Judges each reading once: ``moved`` is what this tick's reading shows, None if there is none.

    A reading is not ``known`` if its quality is low, if it cannot be, or if it is doubted (``ZeroDoubt``,
    ``ReadingDoubt``). Nothing is known while the sensor is silent: motion that nobody saw is unknown, not zero.

    ``watched`` says whether silence is a condition, ``sightless`` that there is no such sensor, and that strides are
    bounded nevertheless, because the witnesses that there are see no slip. ``by_yaw`` says whether a heading that does
    not answer steering counts whenever no motion is seen, not only after a while. ``measures`` is whether the odometer
    goes by this sensor, or by the commands; else another sensor feeds it.

    ``moves`` is whether the newest reading shows that the rover moves. ``stride_over`` says that a rover that sees
    nothing has driven ahead for ``blind_stride_m``, and may have been stuck for all of it, or that something holds it,
    because its heading does not answer steering. ``rolls`` is whether another sensor says that the wheels turn: then
    steering is taken to be that of free ground, which a body with spinning wheels would be taken for as well.
    """

    def __init__(
        self, settings: DetectorSettings, vehicle: Vehicle,
        *, watched: bool, sightless: bool = False, by_yaw: bool = False, measures: bool = True,
    ) -> None:  # fmt: skip
        super().__init__(vehicle.max_speed_m_s)
        self._watched, self._sightless, self._by_yaw, self._measures = watched, sightless, by_yaw, measures
        self._stale_s, self._quality_min = settings.motion_stale_s, settings.quality_min
        self._moves_from_m_s, self._speed_max_m_s = settings.immobilised_from_m_s, settings.motion_speed_max_m_s
        self._blind_stride_m = settings.blind_stride_m
        self.stall = StallMonitor(settings, vehicle)
        self.runaway = RunawayMonitor(settings, vehicle.max_speed_m_s)
        self.odometer = Odometer()
        self._steering = SteeringMonitor(vehicle)
        self._zeros, self._readings = ZeroDoubt(), ReadingDoubt()
        self._blind_m = 0.0  # commanded ahead since motion was seen
        self.moves = self.rolls = self.stride_over = self._lies = False
        self.moved: Moved | None = None
        self._spoke_t_s = 0.0
        self._driven_t_s = self._known_t_s = 0.0

    def start(self, t_s: float) -> None:
        """Begin all ages now."""
        super().start(t_s)
        self._driven_t_s = self._spoke_t_s = self._known_t_s = t_s

    def begin_stride(self) -> None:
        """Begin a stride without sight here."""
        self._blind_m = 0.0
        self._steering.begin()

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
        t_s = interval.t_s
        self._next.drive(interval, turned_deg, self._max_speed_m_s)
        if interval.left or interval.right:
            self._driven_t_s = t_s
        self._zeros.update(interval, turned_deg, reading)
        moved: Moved | None = None
        # A reading of an impossible time, or not later than the last one or the start of the run, is none.
        if reading is not None and self._spoke_t_s < reading.t_s <= t_s:
            moved = self._take(reading, conditions)
        if t_s - self._known_t_s > self._stale_s:
            silent = t_s - self._spoke_t_s > self._stale_s
            if silent:
                self.moves = False
                self.stall.clear()
                self.runaway.clear()
                moved = self._close(t_s) if moved is None else moved
            if self._watched and silent:
                conditions.append(Condition.MOTION_STALE)
            elif self._watched and t_s - self._known_t_s > UNKNOWN_S:
                conditions.append(Condition.MOTION_UNKNOWN)
        self.moved = moved
        if self._measures:
            self.odometer.update(interval.forward_m, moved, self._next.way_m)
        self._steering.update(interval, turned_deg, moves=self.moves or self.rolls)
        self.stride_over = False
        if self._sightless:
            conditions.append(Condition.SLIP_UNSEEN)
        if self.moves:
            self._blind_m = 0.0  # only motion that is seen begins a stride, a few sure zeros do not
        elif (self._watched or self._sightless) and interval.forward_m > 0.0:
            self._blind_m += interval.forward_m
            share = SHORT_SHARE if self._lies or Condition.HEADING_RECKONED in conditions else 1.0
            held = self._steering.unanswered and (self._by_yaw or not BLIND.isdisjoint(conditions))
            if held or self._blind_m >= share * self._blind_stride_m:
                self.begin_stride()
                self.stride_over = True
        if self.runaway.found:
            conditions.append(Condition.RUNAWAY)

    def _take(self, reading: MotionReading, conditions: list[Condition]) -> Moved:
        read_t_s, forward_m, right_m, quality = reading.t_s, reading.forward_m, reading.right_m, reading.quality
        moved = self._close(read_t_s)
        read_s = moved.read_s = read_t_s - self._spoke_t_s
        self._spoke_t_s = read_t_s
        sure = quality >= self._quality_min
        if sure:
            self._lies = self._readings.doubts(reading, moved.commanded_m)
        limit_m = self._speed_max_m_s * read_s
        if not (abs(forward_m) <= limit_m and abs(right_m) <= limit_m and 0.0 <= quality <= 1.0):
            conditions.append(Condition.MOTION_IMPLAUSIBLE)
        elif sure and not self._lies and not self._zeros.doubts:
            moved.see(forward_m, right_m, signed=reading.signed)
        self.stall.add(moved)
        self.moves = moved.known and abs(forward_m) >= self._moves_from_m_s * read_s
        if not moved.known:
            self.runaway.clear()
            return moved
        self._known_t_s = read_t_s
        stood_s = read_t_s - self._driven_t_s
        if stood_s > 0.0 or self.runaway.found:
            self.runaway.add(moved, stood_s)
        return moved


# -- what was covered --------------------------------------------------------------------------------------------------

# No rover goes so far from one reading to the next: after a long silence a sensor may add up what it did not see.
READING_MAX_M: Final = 1.0


class Odometer:
    """Adds up the distance covered, ``covered_m``; driving forwards and backwards both increase it.

    Only what was commanded counts as covered: that is what an algorithm asks. The *displacement* since the last tick,
    ``ahead_m`` and ``right_m``, is for dead reckoning, and has all that was seen: a body on a slope slides while it
    turns, or while its wheels push it uphill.

    Readings come less often than ticks. Between two readings the rover is assumed to cover the same share of the
    commanded distance as at the latest reading. Without a sensor that share is 1. What was assumed too far, as of a
    body that stalls, is subtracted from the next readings, until the direction changes.
    """

    def __init__(self) -> None:
        self.covered_m = self.ahead_m = self.right_m = 0.0
        self._read_m = 0.0  # covered up to the latest reading
        self._share = 1.0
        self._ahead = True
        self._assumed_m = 0.0  # displacement ahead since the latest reading

    def update(self, forward_m: float, moved: Moved | None, since_m: float) -> None:
        """Add a tick.

        Args:
            forward_m: metres that were commanded since the last one, negative in reverse.
            moved: what the motion sensor's new reading shows, None if there is none.
            since_m: metres commanded since the latest reading, both ways added.
        """
        if forward_m and (forward_m > 0.0) is not self._ahead:
            self._ahead = not self._ahead
            # Before a body was seen to stand it was assumed to go on. That must not be subtracted from the way back.
            before_m = (since_m if moved is None else moved.way_m) - abs(forward_m)
            self._read_m = self.covered_m - self._share * before_m
        if moved is not None:
            covered_m = moved.way_m
            if moved.known:
                covered_m = min(abs(moved.forward_m), moved.most_m)
            self._read_m += covered_m
            self._share = covered_m / moved.way_m if covered_m < moved.way_m else 1.0
        before_m = self.covered_m
        self.covered_m = max(self._read_m + self._share * since_m, before_m)
        self.ahead_m = self.covered_m - before_m if forward_m >= 0.0 else before_m - self.covered_m
        self.right_m = 0.0
        if moved is None:
            self._assumed_m += self.ahead_m
            return
        if moved.known and moved.signed and max(abs(moved.forward_m), abs(moved.right_m)) <= READING_MAX_M:
            self.ahead_m, self.right_m = moved.forward_m - self._assumed_m, moved.right_m
        self._assumed_m = 0.0


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
# Turned so far on the spot: as much as shows that a body can turn (``detector.response``).
TURNED_DEG: Final = 9.0
# So many equal readings in a row are not chance: at 5 mm a reading, a PMW3901's noise of 2 counts and more repeats one
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
        if interval.left * interval.right < 0.0:
            if self._ahead_m >= DRIVEN_M and self._back_m >= DRIVEN_M:
                self._turned_deg += abs(turned_deg)  # a turn that is taken back is still a turn
                self.doubts = self._turned_deg >= TURNED_DEG
        elif interval.forward_m > 0.0:
            self._ahead_m += interval.forward_m
        else:
            self._back_m -= interval.forward_m


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
        t_s, forward_m, right_m = reading.t_s, reading.forward_m, reading.right_m
        if forward_m != self._last_m or right_m != self._last_right_m or abs(forward_m) < COUNTS_FROM_M:
            self._repeats = 0
        elif commanded_m:
            self._repeats += 1  # wheels that are stopped must not begin a doubt: motion is a runaway then
        self._last_m, self._last_right_m = forward_m, right_m
        if (commanded_m > 0.0) is not self._ahead:
            self._ahead, self._stopped_s = not self._ahead, -inf
        if abs(commanded_m) >= COUNTS_FROM_M:
            share = abs(forward_m / commanded_m)
            stands = share < STANDS_SHARE
            self._stood = (self._stood << 1 | stands) & ((1 << LATEST) - 1)
            if share >= MOVES_SHARE:
                self._moved = True
            elif self._moved and stands:
                self._moved = False
                if t_s - self._stopped_s > STOPS_EACH_S:
                    self._stops_since_s = t_s
                self._stopped_s = t_s
        stutters = t_s - self._stopped_s <= STOPS_EACH_S and t_s - self._stops_since_s >= STOPS_FOR_S
        return self._repeats >= REPEATS or (stutters and 2 * self._stood.bit_count() >= LATEST)


# -- motion without a command ------------------------------------------------------------------------------------------

G_M_S2: Final = 9.81
# A rover runs away that moves for so long, so long after the last command to move: together the 0.5 s of fault 30.
# Before that it may coast; later too, as long as it loses ``gain_m_s2`` or more of its speed.
AFTER_S: Final = 0.3 - ROUNDING_S
FOR_S: Final = 0.2 - ROUNDING_S
# Motors at duty 0 brake, but do not hold: from 3 degrees on, a body rolls (the rolling resistance of
# ``simhal.world.wheeled_body``), and on mud its braked wheels slide from 6 degrees on (a friction of 0.1). A compass
# has some degrees of noise.
SLIDES_FROM_DEG: Final = 4.0
# Chosen by us: after so long the body has come to rest, or rolls, or is at the foot of the slope. When it was commanded
# to stop it was at most so many times as fast as at full duty: one that was driven down a slope of mud was 1.9 times.
SLIDES_S: Final = 10.0
FASTEST: Final = 2.0
# A flow sensor at another height than configured sees more than the wheels do: by half, measured with ``FIELD``.
FLOW_SCALE_MAX: Final = 1.5


class RunawayMonitor:
    """Finds motion without a command, in one direction; ``found`` says whether it has lasted long enough.

    A body that coasts loses speed, at least ``gain_m_s2`` on the most slippery ground. While it does, it is
    not running away. This monitor does not know whether the rover is armed; a person may push one that is not, so
    the controller ignores the finding then.

    A body that gravity moves downhill is not running away either. It rolls, no faster than the speed at which its
    braked motors take up its weight; or it slides, but only for ``SLIDES_S`` after the stop, and no faster than
    ``FASTEST`` and what free fall along the slope has added since. What is faster is driven.

    ``falls_ahead_deg`` and ``falls_back_deg`` are how far ground or body fall to either end, as far as that is known;
    the most that they may.

    Args:
        settings: from which speed on it moves, and how it coasts.
        max_speed_m_s: ground speed at full duty.
    """

    def __init__(self, settings: DetectorSettings, max_speed_m_s: float) -> None:
        self._from_m_s = settings.runaway_from_m_s
        self._loss_m_s2 = settings.gain_m_s2
        self._max_speed_m_s = max_speed_m_s
        self._coasting: deque[tuple[float, float]] = deque()  # how long zero had been commanded, and the speed
        self.falls_ahead_deg = self.falls_back_deg = 0.0
        self.clear()

    def clear(self) -> None:
        """Forget: nothing is known of the time before now."""
        self._coasting.clear()
        self._moving_s = self._way = 0.0
        self.found = False

    def add(self, moved: Moved, stood_s: float) -> None:
        """Judge with a reading; zero has been commanded for ``stood_s``.

        It counts if most of its time is after the time for coasting. If the sensor sees no direction, the motion may
        be downhill.
        """
        if self._coasting and stood_s <= self._coasting[-1][0]:
            self.clear()
        read_s, way = moved.read_s, copysign(1.0, moved.forward_m)
        speed_m_s = abs(moved.forward_m) / read_s
        coasts = self._slows_down(stood_s, speed_m_s)
        if (
            stood_s - read_s / 2 < AFTER_S
            or speed_m_s < self._from_m_s
            or coasts
            or self._is_pulled(stood_s, speed_m_s, way)
            or (not moved.signed and self._is_pulled(stood_s, speed_m_s, -way))
        ):
            self._moving_s = self._way = 0.0
        else:
            self._moving_s = self._moving_s + read_s if way == self._way else read_s
            self._way = way
        self.found = self._moving_s >= FOR_S

    def _is_pulled(self, stood_s: float, speed_m_s: float, way: float) -> bool:
        """Return whether gravity can move a braked body so fast this way."""
        falls_deg = self.falls_ahead_deg if way > 0.0 else self.falls_back_deg
        fall = sin(radians(falls_deg))
        if speed_m_s <= FLOW_SCALE_MAX * LOAD_MAX * fall * self._max_speed_m_s:
            return True
        slides_m_s = FASTEST * self._max_speed_m_s + G_M_S2 * fall * stood_s
        return falls_deg >= SLIDES_FROM_DEG and stood_s <= SLIDES_S and speed_m_s <= slides_m_s

    def _slows_down(self, stood_s: float, speed_m_s: float) -> bool:
        """Return whether the speed has fallen by at least ``gain_m_s2``, measured over ``FOR_S``."""
        speeds = self._coasting
        speeds.append((stood_s, speed_m_s))
        while len(speeds) > 1 and stood_s - speeds[1][0] >= FOR_S:
            speeds.popleft()
        then_s, then_m_s = speeds[0]
        over_s = stood_s - then_s
        return over_s >= FOR_S and then_m_s - speed_m_s >= self._loss_m_s2 * over_s
