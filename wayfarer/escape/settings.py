"""What the decision logic knows of a rover: the body, and the numbers of the manoeuvres."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees
from typing import Annotated

from annotated_types import Interval

from wayfarer.errors import OutOfRange
from wayfarer.hal import WheelCommand
from wayfarer.setting_ranges import (
    Angle,
    BodyMetres,
    DegreesPerSecond,
    Gain,
    MetresPerSecond,
    SmallAngle,
    StrideMetres,
    check_fields,
)


@dataclass(frozen=True, slots=True)
class Vehicle:
    """What the decision logic knows of the body.

    Raises:
        OutOfRange: a measure is not a number, or outside of its range, which the text says.

    >>> Vehicle(length_m=0.6, width_m=0.5, track_m=0.6, max_speed_m_s=1.2).mix(speed_m_s=0.6, turn_rad_s=0.0)
    WheelCommand(left=0.5, right=0.5)
    """

    length_m: BodyMetres
    """Length of the body, with its bumpers and wheels."""
    width_m: BodyMetres
    """Width of the body, with its wheels."""
    track_m: BodyMetres
    """Effective track for turning: a skid-steered rover slips sideways and turns as if its wheels stood further apart
    than they do. About the width and a quarter."""
    max_speed_m_s: MetresPerSecond
    """Speed at full duty on flat ground."""
    turn_from_duty: Annotated[float, Interval(ge=0, lt=1)] = 0.0
    """Half the difference of the two sides' duties from which the body begins to turn on the spot, as a share of full
    duty. 0 = not measured; it is learnt while driving, from this value on."""

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def full_turn_deg_s(self) -> float:
        """How fast the body turns on the spot at full duty, on ground that takes up none of it."""
        return degrees(2.0 * self.max_speed_m_s / self.track_m)

    def mix(self, speed_m_s: float, turn_rad_s: float) -> WheelCommand:
        """Return the wheel duties for a forward speed and a clockwise turn rate.

        If that asks for more than full duty, both sides are scaled down together: the curve keeps its shape.
        """
        lead_m_s = turn_rad_s * self.track_m / 2
        left_m_s, right_m_s = speed_m_s + lead_m_s, speed_m_s - lead_m_s
        full_m_s = max(self.max_speed_m_s, abs(left_m_s), abs(right_m_s))
        return WheelCommand(left_m_s / full_m_s, right_m_s / full_m_s)


@dataclass(frozen=True, slots=True)
class EscapeSettings:
    """The numbers of the manoeuvres.

    The distances are those of the paper's released simulator, so that its results can be compared: reverse 0.15 m,
    straight 0.6 m, then an arc of 5 degrees every 0.1 m (radius 1.15 m), strides of the Lévy walk 0.6 to 10 m.
    The turn angle, the 5 degree reset and the 20 degree compatibility are from the paper, section III.

    Raises:
        OutOfRange: one is not a number, or outside of its range, which the text says; or a smallest one is above its
            largest one.

    >>> EscapeSettings(cruise_m_s=0.5).turn_angle_deg
    30.0
    """

    cruise_m_s: MetresPerSecond = 1.0
    """Speed of all driving ahead. The released field code drives with 0.3 of full duty."""
    reverse_m_s: MetresPerSecond = 0.6
    """Speed of backing off."""
    turn_deg_s: DegreesPerSecond = 180.0
    """Fastest turn."""
    turn_p: Gain = 6.0
    """Gain of a turn: deg/s per degree that is left."""
    turn_within_deg: SmallAngle = 3.0
    """A turn is done when so little is left."""
    back_off_m: StrideMetres = 0.15
    """How far the rover backs off from what stopped it."""
    turn_angle_deg: Angle = 30.0
    """Angle of the turn away from it."""
    probe_straight_m: StrideMetres = 0.6
    """A probe begins with this straight piece."""
    probe_radius_m: StrideMetres = 1.15
    """Radius of the arc by which a probe goes on, back towards the obstacle."""
    reset_within_deg: SmallAngle = 5.0
    """A probe is done, and the counter C is forgotten, when the heading is so near the goal."""
    compatible_within_deg: SmallAngle = 20.0
    """An obstacle whose axis is so near the goal heading is compatible with it (OO-Pledge)."""
    react_stride_m: StrideMetres = 0.6
    """Stride of the algorithms that only react."""
    levy_stride_min_m: StrideMetres = 0.6
    """Shortest stride of a Lévy walk."""
    levy_stride_max_m: Annotated[float, Interval(ge=0.5, le=200)] = 10.0
    """Longest stride of a Lévy walk."""
    levy_turn_min_deg: SmallAngle = 10.0
    """Smallest turn of a Lévy walk."""
    levy_turn_max_deg: Angle = 50.0
    """Largest turn of a Lévy walk."""
    heading_p: Gain = 3.0
    """Gain of the heading loop: deg/s per degree of error."""
    heading_i: Gain = 0.2
    """Its integral gain: deg/s per degree of error and second."""
    heading_d: Gain = 0.0
    """Its derivative gain: deg/s per deg/s of error."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.levy_stride_min_m > self.levy_stride_max_m or self.levy_turn_min_deg > self.levy_turn_max_deg:
            raise OutOfRange("levy_stride_min_m and levy_turn_min_deg must not exceed their _max_")
