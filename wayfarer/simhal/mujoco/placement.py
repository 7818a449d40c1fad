"""The rover's body in the engine: its pose, and free and level places to put it down, clear of every obstacle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import asin, atan2, cos, degrees, pi, radians, sin
from typing import Any, NamedTuple

import mujoco

from wayfarer.angles import clamp
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.mujoco.ground import HeightField, Nearby
from wayfarer.simhal.mujoco.model import Contacts
from wayfarer.simhal.world.wheeled_body import WheeledBody

# -- kinematics ------------------------------------------------------------------------------------------------------
# Pose of the body from the engine's state, distance over ground at its middle, and the forces of faults.

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


PUT_DOWN_FROM_M = 0.005
STEP_M = 0.01  # between two places that are tried
WITHIN_LENGTHS = 3.0  # of the body, around where it is; chosen by us: as far as a person carries it and says "here"
DIRECTIONS = tuple(pi + turned * pi / 4.0 for turned in (0, 1, -1, 2, -2, 3, -3, 4))  # from straight behind to ahead

Place = tuple[float, float]


class NoRoom(RuntimeError):
    """There is no free ground near the rover to put it down on; the trial cannot continue."""


class Placement:
    """Puts a body elsewhere in its world; what it touches there are ``contacts``, of what is ``nearby``."""

    def __init__(
        self,
        model: Any,
        data: Any,
        body: WheeledBody,
        field: HeightField | None,
        contacts: Contacts,
        nearby: Nearby,
    ) -> None:
        self._model, self._data = model, data
        self._body = body
        self._field = field
        self._contacts = contacts
        self._nearby = nearby

    def lift_to(self, x_m: float, y_m: float, heading_rad: float, above_m: float = PUT_DOWN_FROM_M) -> None:
        """Hold the body level, this much above the highest ground under it, at rest."""
        self._nearby.follow(x_m, y_m)
        data, body = self._data, self._body
        reach_m = max(body.length_m, body.width_m) / 2.0
        ground_m = self._field.top_m(x_m, y_m, reach_m) if self._field else 0.0
        half_rad = (radians(90.0) - heading_rad) / 2.0  # the body's x axis is ahead, and 0 is north
        data.qpos[:3] = x_m, y_m, ground_m + body.wheel_radius_m + above_m
        data.qpos[3:7] = cos(half_rad), 0.0, 0.0, sin(half_rad)
        data.qvel[:] = 0.0

    def free_places(self, x_m: float, y_m: float, heading_rad: float, back_m: float) -> Iterator[Place]:
        """Yield where the body is free with this heading: the best place first.

        From where it is, or else from the nearest free place around, the body goes back as far as is free up to
        ``back_m``. Of equally near places the one behind comes first: that is where it came from.

        Raises:
            NoRoom: once there are no more places.
        """
        for near in self._around(x_m, y_m, heading_rad):
            if self._is_free(*near, heading_rad):
                yield self._further_back(*near, heading_rad, back_m)
        raise NoRoom(f"no free ground near x = {x_m:.2f} m, y = {y_m:.2f} m to put the rover down on")

    def _around(self, x_m: float, y_m: float, heading_rad: float) -> Iterator[Place]:
        yield x_m, y_m
        for ring in range(1, round(WITHIN_LENGTHS * self._body.length_m / STEP_M) + 1):
            for turned_rad in DIRECTIONS:
                yield _moved(x_m, y_m, heading_rad + turned_rad, ring * STEP_M)

    def _further_back(self, x_m: float, y_m: float, heading_rad: float, back_m: float) -> Place:
        free = x_m, y_m
        for step in range(1, round(back_m / STEP_M) + 1):
            behind = _moved(x_m, y_m, heading_rad + pi, step * STEP_M)
            if not self._is_free(*behind, heading_rad):
                break
            free = behind
        return free

    def _is_free(self, x_m: float, y_m: float, heading_rad: float) -> bool:
        self.lift_to(x_m, y_m, heading_rad, above_m=0.0)
        mujoco.mj_fwdPosition(self._model, self._data)
        return not self._contacts.with_obstacles()


def _moved(x_m: float, y_m: float, bearing_rad: float, distance_m: float) -> Place:
    return x_m + distance_m * sin(bearing_rad), y_m + distance_m * cos(bearing_rad)
