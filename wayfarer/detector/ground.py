"""The slope of the ground, the tilt that is counted from it, and the duty that it takes up. Pure.

A body on a hillside is tilted as one on a trunk is. The difference is how far the tilt reaches: a hillside changes over
metres, a nose is on a trunk within the length of a body. So the slope is learnt per metre that the motion sensor sees,
not per second. A body that stands, that pushes with spinning wheels, or that sees nothing learns nothing.

These rovers have no speed loop: a slope takes up a share of the duty. Uphill at 0.3 of full duty a rover crawls, or
rolls back; downhill it is too fast. The share is ``load * sin(pitch)``: ``load`` is the rover's weight over the push of
its motors at full duty. It is learnt while the body is seen to move. The pitch is that of the *ground*, so a body that
a trunk holds or lifts gets no more duty for it, and a stall stays one. On ground that counts as flat nothing is added.
"""

from __future__ import annotations

from math import cos, hypot, inf, sin
from typing import Final

from wayfarer.angles import RAD_PER_DEG, clamp
from wayfarer.detector.settings import DetectorSettings
from wayfarer.escape.api import Anomaly
from wayfarer.escape.settings import Vehicle
from wayfarer.hal import STOP, CompassReading, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import Debounce, Moved, TickInterval

# After so much driving, the estimate has taken over 63 % of a change. Many times the 0.2 m that a nose needs to rise
# (docs/explanation/scenarios.md, "Before it tips": 0.3 s at 1 m/s), and less than a hillside is long. Chosen by us.
LEARN_M: Final = 2.0
# A difference counts as at most this much, so that the estimate changes by at most 5 degrees per metre: 1 degree while
# a nose rises at a trunk. Chosen by us.
DIFFERENCE_MAX_DEG: Final = 10.0
# Wheels climb at most 27 degrees of moist loam (its friction, Noon 1994, less rolling resistance); other ground less.
SLOPE_MAX_DEG: Final = 25.0
# A flatter ground counts as flat: then noise and trunks on flat ground change no limit.
LEVEL_DEG: Final = 5.0
# Driven so far without sight, the rover may be on another slope. Chosen by us; a body on the spot drives less.
UNSEEN_M: Final = 1.0


class GroundSlope:
    """Estimates how many degrees the ground rises to the north and to the east: a vector that no turn changes.

    ``flat`` is whether the ground counts as flat.

    For angles up to ``SLOPE_MAX_DEG`` angles are added like a vector's parts; the error is below a degree.
    """

    def __init__(self) -> None:
        self._north_deg = self._east_deg = 0.0
        self._unseen_m = 0.0  # driven since the slope was sure
        self._size_deg = 0.0
        self.flat = True
        self._heading_known = True

    def begin(self, believed: CompassReading) -> None:
        """Take the attitude of a body that stands where a person has put it down, up to ``SLOPE_MAX_DEG``."""
        self._unseen_m = 0.0
        self._set(*_turned(believed.pitch_deg, believed.roll_deg, believed.heading_deg))

    def update(
        self, believed: CompassReading, moved: Moved | None, driven_m: float, *, moves: bool, heading_known: bool
    ) -> None:
        """Take in a tick.

        Args:
            believed: heading and attitude that decisions use.
            moved: what the motion sensor's new reading shows, None if there is none.
            driven_m: metres commanded ahead since the last tick, negative in reverse.
            moves: whether the motion sensor sees the body move.
            heading_known: whether the heading is the compass's, without a doubt.
        """
        self._heading_known = heading_known
        self._unseen_m += abs(driven_m)
        if moved is None or not moved.known or not heading_known:
            return
        self._unseen_m = max(0.0, self._unseen_m - moved.way_m)
        if not (moves and moved.way_m):
            return
        # Come nearer to the attitude, by a share for this distance.
        share = moved.way_m / (LEARN_M + moved.way_m)
        self._unseen_m -= share * self._unseen_m
        north_deg, east_deg = _turned(believed.pitch_deg, believed.roll_deg, believed.heading_deg)
        north_deg -= self._north_deg
        east_deg -= self._east_deg
        if not _is_within(north_deg, east_deg, DIFFERENCE_MAX_DEG):
            share *= DIFFERENCE_MAX_DEG / hypot(north_deg, east_deg)
        self._set(self._north_deg + share * north_deg, self._east_deg + share * east_deg)

    def towards_deg(self, heading_deg: float) -> tuple[float, float, float, float]:
        """Return how far the ground tilts a body with this heading: nose up, nose down, right down, left down.

        If heading or place is not known, the ground may tilt it by the whole slope to any side.
        """
        if self.flat:
            return 0.0, 0.0, 0.0, 0.0
        if not self._known:
            return self._size_deg, self._size_deg, self._size_deg, self._size_deg
        pitch_deg, roll_deg = _turned(self._north_deg, self._east_deg, heading_deg)
        return pitch_deg, -pitch_deg, roll_deg, -roll_deg

    def pitch_deg(self, heading_deg: float) -> float:
        """Return how far the ground rises ahead with this heading; 0 if it counts as flat or is not known."""
        if self.flat or not self._known:
            return 0.0
        return _turned(self._north_deg, self._east_deg, heading_deg)[0]

    @property
    def _known(self) -> bool:
        return self._heading_known and self._unseen_m <= UNSEEN_M

    def _set(self, north_deg: float, east_deg: float) -> None:
        self.flat = _is_within(north_deg, east_deg, LEVEL_DEG)
        if self.flat:
            self._north_deg, self._east_deg = north_deg, east_deg
            return
        size_deg = hypot(north_deg, east_deg)
        bound = SLOPE_MAX_DEG / size_deg if size_deg > SLOPE_MAX_DEG else 1.0
        self._north_deg, self._east_deg, self._size_deg = bound * north_deg, bound * east_deg, bound * size_deg


def _is_within(north_deg: float, east_deg: float, limit_deg: float) -> bool:
    """Return whether a rise is below a limit: nearly always the sum of its parts is, and ``hypot`` is slow."""
    return abs(north_deg) + abs(east_deg) < limit_deg or hypot(north_deg, east_deg) < limit_deg


def _turned(first_deg: float, second_deg: float, heading_deg: float) -> tuple[float, float]:
    """Return the rise to north and east of a pitch and a roll, or the pitch and the roll of a rise to north and east.

    It is the same formula both ways, because roll is positive where the ground falls to the right.
    """
    heading_rad = heading_deg * RAD_PER_DEG
    sin_h, cos_h = sin(heading_rad), cos(heading_rad)
    return first_deg * cos_h + second_deg * sin_h, first_deg * sin_h - second_deg * cos_h


# -- tilt --------------------------------------------------------------------------------------------------------------

# A body that is so far from upright lies on its side or its back; for longer than one reading with a flipped bit.
OVERTURNED_DEG: Final = 60.0
OVERTURNED_S: Final = 0.1
TILTS: Final = (Anomaly.NOSE_UP, Anomaly.NOSE_DOWN, Anomaly.RIGHT_DOWN, Anomaly.LEFT_DOWN)


class TiltMonitor:
    """Judges pitch and roll.

    A tilt to one of the four sides counts once it has lasted, separately for each side. It is counted from the ground.
    Counted from the horizontal, a tilt counts on any ground once a bump of half of the limit would bring the body to
    ``tipping_deg``.

    A body that is tipping over to a side counts as tilted at once: its tilt grows so fast that it would soon be too
    much. The rate is that of the slower of the last two steps between readings, so that one wrong reading or one bump
    does not count as tipping. A tilt below half of the limit does not either. Tipping and overturned are
    counted from the horizontal.
    """

    def __init__(self, settings: DetectorSettings, ground: GroundSlope) -> None:
        self._ground = ground
        self._limit_deg = settings.tilt_deg
        self._floor_deg = settings.tilt_deg / 2.0
        self._most_deg = max(settings.tilt_deg, settings.tipping_deg - self._floor_deg)
        self._tipping_deg, self._tipping_s = settings.tipping_deg, settings.tipping_s
        self._old: CompassReading | None = None  # the last three readings
        self._mid: CompassReading | None = None
        self._new: CompassReading | None = None
        self._new_t_s = -inf
        self._tilts = {tilt: Debounce(settings.tilt_s) for tilt in TILTS}
        self._overturned = Debounce(OVERTURNED_S)
        self._tilted = False

    def update(
        self, t_s: float, believed: CompassReading, anomalies: list[Anomaly], conditions: list[Condition]
    ) -> None:
        """Judge a tick, and add what is found to ``anomalies`` and ``conditions``."""
        read_t_s, pitch_deg, roll_deg = believed.t_s, believed.pitch_deg, believed.roll_deg
        if self._new_t_s < read_t_s:
            self._old, self._mid, self._new, self._new_t_s = self._mid, self._new, believed, read_t_s
        ground, limit_deg, floor_deg = self._ground, self._limit_deg, self._floor_deg
        if ground.flat and abs(pitch_deg) < floor_deg and abs(roll_deg) < floor_deg and not self._tilted:
            return  # nearly every tick ends here
        self._tilted = False
        slopes_deg = ground.towards_deg(believed.heading_deg)
        for tilt, angle_deg, slope_deg in zip(TILTS, _towards_deg(believed), slopes_deg, strict=True):
            beyond = angle_deg - slope_deg >= limit_deg or angle_deg >= self._most_deg
            self._tilted |= beyond
            lasts = self._tilts[tilt].update(t_s, beyond)
            if lasts or (angle_deg >= floor_deg and self._tips(tilt)):
                anomalies.append(tilt)
        if self._overturned.update(t_s, max(abs(pitch_deg), abs(roll_deg)) >= OVERTURNED_DEG):
            conditions.append(Condition.OVERTURNED)

    def _tips(self, tilt: Anomaly) -> bool:
        """Return whether the body will be tilted too far towards that side in a moment."""
        old, mid, new = self._old, self._mid, self._new
        if old is None or mid is None or new is None:
            return False
        side = TILTS.index(tilt)
        old_deg, mid_deg, new_deg = (_towards_deg(reading)[side] for reading in (old, mid, new))
        rate_deg_s = min((mid_deg - old_deg) / (mid.t_s - old.t_s), (new_deg - mid_deg) / (new.t_s - mid.t_s))
        ahead_s = new.t_s - mid.t_s + self._tipping_s  # from the middle reading: the newest one alone may be wrong
        return rate_deg_s > 0.0 and mid_deg + rate_deg_s * ahead_s >= self._tipping_deg


def _towards_deg(reading: CompassReading) -> tuple[float, float, float, float]:
    """Return the tilt towards each of the four sides."""
    return reading.pitch_deg, -reading.pitch_deg, reading.roll_deg, -reading.roll_deg


# -- duty --------------------------------------------------------------------------------------------------------------

# ForestRover's is 0.86 if the torque in the paper is that of stall, and 0.29 if it is the rated one, as of a third of
# stall. The first guess is between them. The most is chosen by us: it is that of a body that slides in a turn.
LOAD: Final = 0.6
LOAD_MAX: Final = 2.0
# Driven so far, the estimate has taken over 63 % of a change; a start is left out, because a body follows its wheels
# with a lag. Chosen by us.
LOAD_LEARN_M: Final = 0.5
STEADY_S: Final = 0.3
# A body on a flatter leg shows too little of the load.
LEARN_FROM_DEG: Final = 4.0
# Downhill at least this share of the commanded duty is kept: a load that is learnt too high must not stop the rover.
DOWNHILL_SHARE: Final = 0.5


class GradeCompensation:
    """Adds the duty that the slope takes up.

    Call ``update`` once per tick, ``compensate`` for a decision of the algorithm, then ``on_flat_ground`` for what was
    applied.
    Turns on the spot have a separate load: wheels that slip sideways push less against the slope.

    Args:
        vehicle: gives the ground speed at full duty.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._max_speed_m_s = vehicle.max_speed_m_s
        self._loads = [LOAD, LOAD]  # while it drives, and in a turn on the spot
        self._rise = 0.0
        self._added = 0.0  # duty that this decision got against the slope
        self._uncompensated = 0.0  # what it lacks for all of the slope: positive downhill, where the slope drives
        self._way = 0  # 1 ahead, -1 back, 0 a turn on the spot
        self._steady_s = 0.0
        self._uncompensated_m = 0.0  # how far the slope that is not compensated drives the body, since the last reading

    def update(self, interval: TickInterval, moved: Moved | None, pitch_deg: float, *, free: bool) -> None:
        """Take in a tick.

        Args:
            interval: the wheel commands before it, as ``on_flat_ground`` gave them.
            moved: what the motion sensor's new reading shows, None if there is none.
            pitch_deg: the ground's slope ahead, positive uphill; 0 if it is flat or not known.
            free: whether the body moves, and nothing seems to hold it.
        """
        uncompensated, self._added, self._uncompensated = self._uncompensated, 0.0, 0.0
        self._rise = sin(pitch_deg * RAD_PER_DEG) if pitch_deg else 0.0
        left, right = interval.left, interval.right
        way = 0 if left * right < 0.0 else 1 if left + right > 0.0 else -1
        self._steady_s = self._steady_s + interval.driven_s if way == self._way and free else 0.0
        self._way = way
        self._uncompensated_m += uncompensated * self._max_speed_m_s * interval.driven_s
        if moved is None:
            return
        missed_m = moved.commanded_m + self._uncompensated_m - moved.forward_m
        self._uncompensated_m = 0.0
        if self._steady_s >= STEADY_S and abs(pitch_deg) >= LEARN_FROM_DEG and moved.known and moved.driven_s > 0.0:
            # By how much the body was slower ahead than expected, as a share of the speed at full duty.
            missed = missed_m / (moved.driven_s * self._max_speed_m_s)
            pivots, moved_m = left * right < 0.0, abs(moved.forward_m)
            load = self._loads[pivots] + missed / self._rise * moved_m / (LOAD_LEARN_M + moved_m)
            self._loads[pivots] = clamp(load, 0.0, LOAD_MAX)

    def compensate(self, wheels: WheelCommand) -> WheelCommand:
        """Return the duties that drive the body on this slope as ``wheels`` would on flat ground; turning comes first.

        A pivot is held in its place. A stop stays a stop.
        """
        if not self._rise or wheels == STOP:
            return wheels
        left, right = wheels.left, wheels.right
        ahead, turn, slope = (left + right) / 2.0, (left - right) / 2.0, self._loads[left * right < 0.0] * self._rise
        added = slope
        if ahead * slope < 0.0:
            most = (1.0 - DOWNHILL_SHARE) * abs(ahead)
            added = clamp(slope, -most, most)
        room = max(1.0 - abs(turn), abs(ahead))
        driven = clamp(ahead + added, -room, room)
        self._added = driven - ahead
        self._uncompensated = self._added - slope
        return WheelCommand(driven + turn, driven - turn)

    def on_flat_ground(self, applied: WheelCommand) -> WheelCommand:
        """Return the duties that would drive the body on flat ground as ``applied`` does on this slope."""
        if not self._added or applied == STOP:
            return applied
        return WheelCommand(applied.left - self._added, applied.right - self._added)
