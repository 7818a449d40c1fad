"""Compass angles: degrees, clockwise positive, 0 is north; metres from headings and places; and values within bounds.

One place for wrap-around, because published drivers and filters get it wrong again and again (averaging 359 and 1
gives 180).
"""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, cos, degrees, hypot, pi, radians, sin
from typing import Final, Protocol

# What math.radians and math.degrees multiply by. As calls they are slow in what is compiled and done in each tick.
RAD_PER_DEG: Final = pi / 180.0
DEG_PER_RAD: Final = 180.0 / pi
METRES_PER_DEG: Final = 111_320.0  # of latitude; the WGS 84 ellipsoid has 110,574 (equator) to 111,694 (poles)


class Coordinates(Protocol):
    """A place on the globe, degrees."""

    @property
    def latitude_deg(self) -> float:
        """Degrees north of the equator."""

    @property
    def longitude_deg(self) -> float:
        """Degrees east of Greenwich."""


def clamp(value: float, low: float, high: float) -> float:
    """Return the value, or the bound that it is beyond; NaN stays NaN. If the bounds cross, ``high`` counts."""
    return min(max(value, low), high)


def wrap180(angle_deg: float) -> float:
    """Return the angle in [-180, 180): the shortest signed turn, clockwise positive."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def wrap360(angle_deg: float) -> float:
    """Return the angle in [0, 360); tiny negative angles come back as 0, never as 360."""
    wrapped = angle_deg % 360.0
    return wrapped if wrapped < 360.0 else 0.0


def axis_offset_deg(axis_deg: float, heading_deg: float) -> float:
    """Return the signed angle in [-90, 90) from a heading to an undirected axis, such as a fallen trunk."""
    return (axis_deg - heading_deg + 90.0) % 180.0 - 90.0


def circular_mean(angles_deg: Iterable[float]) -> tuple[float, float]:
    """Return (mean heading in [0, 360), resultant length in 0..1; near 0 means the angles cancel out).

    Raises:
        ValueError: there are no angles.
    """
    angles = [radians(angle_deg) for angle_deg in angles_deg]
    if not angles:
        raise ValueError("no angles to average")
    north = sum(cos(a) for a in angles) / len(angles)
    east = sum(sin(a) for a in angles) / len(angles)
    return bearing_deg(north, east), min(1.0, hypot(north, east))


def bearing_deg(north: float, east: float) -> float:
    """Return the compass direction of an offset, in [0, 360)."""
    return wrap360(degrees(atan2(east, north)))


def displacement_m(heading_deg: float, forward_m: float, right_m: float = 0.0) -> tuple[float, float]:
    """Return metres (north, east) of a move along and across a heading: one step of dead reckoning."""
    heading_rad = heading_deg * RAD_PER_DEG
    ahead, aside = cos(heading_rad), sin(heading_rad)
    return forward_m * ahead - right_m * aside, forward_m * aside + right_m * ahead


def offset_m(origin: Coordinates, place: Coordinates) -> tuple[float, float]:
    """Return metres (north, east) from an origin to a place, on a plane: within 0.7 % for a few kilometres."""
    north_m = (place.latitude_deg - origin.latitude_deg) * METRES_PER_DEG
    east_deg = wrap180(place.longitude_deg - origin.longitude_deg)
    return north_m, east_deg * METRES_PER_DEG * cos(radians(origin.latitude_deg))


def coordinates_deg(origin: Coordinates, north_m: float, east_m: float) -> tuple[float, float]:
    """Return (latitude, longitude), degrees, of a place north and east of an origin: the inverse of ``offset_m``."""
    return (
        origin.latitude_deg + north_m / METRES_PER_DEG,
        origin.longitude_deg + east_m / (METRES_PER_DEG * cos(radians(origin.latitude_deg))),
    )
