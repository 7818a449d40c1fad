"""Pose of the body from the engine's state, distance over ground at its middle, and the forces of faults."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, cos, degrees, radians, sin
from typing import NamedTuple

from wayfarer.clamp import clamp
from wayfarer.config.chassis import STANDARD_GRAVITY_M_S2

SHOVE_S = 0.1  # in which a shove brings the body to its speed
MOST_WEIGHTS = 2.0  # and with no more force than this many times its weight


class Pose(NamedTuple):
    """Of the middle between the wheels: metres east and north, radians clockwise from north, nose up, right down."""

    x_m: float
    y_m: float
    heading_rad: float
    pitch_deg: float
    roll_deg: float


def pose_of(qpos: Sequence[float]) -> Pose:
    """Return the pose of a free body: from its axis ahead, and how it is turned about that."""
    x_m, y_m, _, w, x, y, z = qpos
    return Pose(
        x_m,
        y_m,
        atan2(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)),
        degrees(asin(clamp(2.0 * (x * z - w * y), -1.0, 1.0))),
        degrees(atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))),
    )


class Displacement:
    """Adds up, look by look, how far the body has moved along its own axes; ``start_at`` comes first.

    ``forward_m``, ``reverse_m`` and ``right_m`` are how far until the latest pose.
    """

    def __init__(self) -> None:
        self._forward_m = self._reverse_m = self._right_m = 0.0  # until the latest look

    def start_at(self, pose: Pose) -> None:
        """Count from here on, as after the body was carried."""
        self._x_m, self._y_m = pose.x_m, pose.y_m
        self.forward_m, self.reverse_m, self.right_m = self._forward_m, self._reverse_m, self._right_m

    def follow(self, pose: Pose) -> float:
        """Take the latest pose; return how far it is ahead of the latest look, negative backwards."""
        east_m, north_m = pose.x_m - self._x_m, pose.y_m - self._y_m
        sin_h, cos_h = sin(pose.heading_rad), cos(pose.heading_rad)
        ahead_m = east_m * sin_h + north_m * cos_h
        self.forward_m, self.reverse_m = self._forward_m, self._reverse_m
        if ahead_m < 0.0:
            self.reverse_m -= ahead_m
        else:
            self.forward_m += ahead_m
        self.right_m = self._right_m + (east_m * cos_h - north_m * sin_h)
        return ahead_m

    def look(self, pose: Pose) -> float:
        """Take the latest pose and keep what has been moved; return how much of it was ahead, negative backwards."""
        ahead_m = self.follow(pose)
        self._forward_m, self._reverse_m, self._right_m = self.forward_m, self.reverse_m, self.right_m
        self._x_m, self._y_m = pose.x_m, pose.y_m
        return ahead_m


def gravity_m_s2(pitch_deg: float, roll_deg: float, heading_rad: float) -> tuple[float, float, float]:
    """Return gravity east, north and up as it pulls on ground that slopes so under a body with this heading."""
    pitch_rad, roll_rad = radians(pitch_deg), radians(roll_deg)
    sin_h, cos_h = sin(heading_rad), cos(heading_rad)
    ahead_m_s2 = -STANDARD_GRAVITY_M_S2 * sin(pitch_rad)
    right_m_s2 = STANDARD_GRAVITY_M_S2 * cos(pitch_rad) * sin(roll_rad)
    down_m_s2 = STANDARD_GRAVITY_M_S2 * cos(pitch_rad) * cos(roll_rad)
    return ahead_m_s2 * sin_h + right_m_s2 * cos_h, ahead_m_s2 * cos_h - right_m_s2 * sin_h, -down_m_s2


def shove_n(weight_kg: float, wanted_m_s: float, speed_m_s: float) -> float:
    """Return the force ahead that brings a body from one speed to another."""
    most_n = MOST_WEIGHTS * weight_kg * STANDARD_GRAVITY_M_S2
    return clamp(weight_kg * (wanted_m_s - speed_m_s) / SHOVE_S, -most_n, most_n)
