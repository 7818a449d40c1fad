"""Compass angles: degrees, clockwise positive, 0 is north.

One place for wrap-around, because published drivers and filters get it wrong again and again (averaging 359 and 1
gives 180).
"""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, cos, degrees, hypot, radians, sin


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
    return wrap360(degrees(atan2(east, north))), min(1.0, hypot(north, east))
