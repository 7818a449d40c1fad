"""The slope of the ground under the rover, learnt from the attitude of a body that is seen to move over it.

A body on a hillside is tilted as one on a trunk is. The difference is how far the tilt reaches: a hillside changes over
metres, a nose is on a trunk within the length of a body. So the slope is learnt per metre that the motion sensor sees,
not per second. A body that stands, that pushes with spinning wheels, or that sees nothing learns nothing.
"""

from __future__ import annotations

from math import cos, hypot, radians, sin
from typing import Final

from wayfarer.hal import CompassReading, MotionReading

# After so much driving, the estimate has taken over 63 % of a change. Many times the 0.2 m that a nose needs to rise
# (docs/explanation/scenarios.md, "Before it tips": 0.3 s at 1 m/s), and less than a hillside is long. From no source.
LEARN_M: Final = 2.0
# A difference counts as at most this much, so that the estimate changes by at most 5 degrees per metre: 1 degree while
# a nose rises at a trunk. From no source.
DIFFERENCE_MAX_DEG: Final = 10.0
# Wheels climb at most 27 degrees of moist loam (its friction, Noon 1994, less rolling resistance); other ground less.
SLOPE_MAX_DEG: Final = 25.0
# A flatter ground counts as level: then noise and trunks on level ground change no limit.
LEVEL_DEG: Final = 5.0
# Driven so far without sight, the rover may be on another slope. From no source; a body on the spot drives less.
UNSEEN_M: Final = 1.0


class GroundSlope:
    """Estimates how many degrees the ground rises to the north and to the east: a vector that no turn changes.

    For angles up to ``SLOPE_MAX_DEG`` angles are added like a vector's parts; the error is below a degree.

    Args:
        quality_min: the lowest quality of a motion reading that is used, 0 to 1.
    """

    def __init__(self, quality_min: float) -> None:
        self._quality_min = quality_min
        self._north_deg = self._east_deg = 0.0
        self._driven_m = self._unseen_m = 0.0
        self._size_deg = 0.0
        self._heading_known = True

    @property
    def level(self) -> bool:
        """Whether the ground counts as level."""
        return self._size_deg < LEVEL_DEG

    def begin(self, believed: CompassReading) -> None:
        """Take the attitude of a body that stands where a person has put it down, up to ``SLOPE_MAX_DEG``."""
        self._driven_m = self._unseen_m = 0.0
        self._set(*_turned(believed.pitch_deg, believed.roll_deg, believed.heading_deg))

    def update(
        self,
        believed: CompassReading,
        motion: MotionReading | None,
        driven_m: float,
        *,
        moves: bool,
        heading_known: bool,
    ) -> None:
        """Take in a tick.

        Args:
            believed: heading and attitude that decisions use.
            motion: what may be believed of the motion sensor's new reading, None where there is none.
            driven_m: metres commanded ahead since the last tick, negative in reverse.
            moves: whether the motion sensor sees the body move.
            heading_known: whether the heading is the compass's, without a doubt.
        """
        self._heading_known = heading_known
        self._driven_m += abs(driven_m)
        if motion is None:
            return
        driven_m, self._driven_m = self._driven_m, 0.0
        if not heading_known or motion.quality < self._quality_min:
            self._unseen_m += driven_m
        elif moves and driven_m:
            self._learn(believed, driven_m)

    def towards_deg(self, heading_deg: float) -> tuple[float, float, float, float]:
        """Return how far the ground tilts a body with this heading: nose up, nose down, right down, left down.

        Where heading or place is not known, the ground may tilt it by the whole slope to any side.
        """
        if self.level:
            return 0.0, 0.0, 0.0, 0.0
        if not self._known:
            return self._size_deg, self._size_deg, self._size_deg, self._size_deg
        pitch_deg, roll_deg = _turned(self._north_deg, self._east_deg, heading_deg)
        return pitch_deg, -pitch_deg, roll_deg, -roll_deg

    def pitch_deg(self, heading_deg: float) -> float:
        """Return how far the ground rises ahead with this heading; 0 where it counts as level or is not known."""
        if self.level or not self._known:
            return 0.0
        return _turned(self._north_deg, self._east_deg, heading_deg)[0]

    @property
    def _known(self) -> bool:
        return self._heading_known and self._unseen_m + self._driven_m <= UNSEEN_M

    def _learn(self, believed: CompassReading, driven_m: float) -> None:
        """Come nearer to the attitude, by a share for this distance."""
        share = driven_m / (LEARN_M + driven_m)
        self._unseen_m -= share * self._unseen_m
        north_deg, east_deg = _turned(believed.pitch_deg, believed.roll_deg, believed.heading_deg)
        north_deg -= self._north_deg
        east_deg -= self._east_deg
        difference_deg = hypot(north_deg, east_deg)
        if difference_deg > DIFFERENCE_MAX_DEG:
            share *= DIFFERENCE_MAX_DEG / difference_deg
        self._set(self._north_deg + share * north_deg, self._east_deg + share * east_deg)

    def _set(self, north_deg: float, east_deg: float) -> None:
        size_deg = hypot(north_deg, east_deg)
        bound = SLOPE_MAX_DEG / size_deg if size_deg > SLOPE_MAX_DEG else 1.0
        self._north_deg, self._east_deg, self._size_deg = bound * north_deg, bound * east_deg, bound * size_deg


def _turned(first_deg: float, second_deg: float, heading_deg: float) -> tuple[float, float]:
    """Return the rise to north and east of a pitch and a roll, or the pitch and the roll of a rise to north and east.

    It is the same formula both ways, because roll is positive where the ground falls to the right.
    """
    sin_h, cos_h = sin(radians(heading_deg)), cos(radians(heading_deg))
    return first_deg * cos_h + second_deg * sin_h, first_deg * sin_h - second_deg * cos_h
