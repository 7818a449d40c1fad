"""Orientations as in Foxglove and ROS (REP 103): x east, y north, z up; of a body x ahead, y left, z up. Pure."""

from __future__ import annotations

from math import cos, radians, sin
from typing import NamedTuple


class Rotation(NamedTuple):
    """A unit quaternion."""

    x: float
    y: float
    z: float
    w: float


def enu_rotation(heading_deg: float, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Rotation:
    """Return a body's rotation in the map; pitch is positive nose up, roll right side down, turned in this order.

    A compass counts clockwise from north, a map counter-clockwise from east.
    """
    half = [radians(angle_deg) / 2.0 for angle_deg in (90.0 - heading_deg, -pitch_deg, roll_deg)]
    (c_yaw, s_yaw), (c_pitch, s_pitch), (c_roll, s_roll) = ((cos(angle), sin(angle)) for angle in half)
    return Rotation(
        x=s_roll * c_pitch * c_yaw - c_roll * s_pitch * s_yaw,
        y=c_roll * s_pitch * c_yaw + s_roll * c_pitch * s_yaw,
        z=c_roll * c_pitch * s_yaw - s_roll * s_pitch * c_yaw,
        w=c_roll * c_pitch * c_yaw + s_roll * s_pitch * s_yaw,
    )
