"""Finds free and level places to put a rover down, clear of every obstacle."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, radians, sin
from typing import Any

import mujoco

from wayfarer.simhal.mujoco.ground import HeightField
from wayfarer.simhal.mujoco.model import Contacts
from wayfarer.simhal.mujoco.nearby import Nearby
from wayfarer.simhal.world.wheeled_body import WheeledBody

PUT_DOWN_FROM_M = 0.005
STEP_M = 0.01  # between two places that are tried
WITHIN_LENGTHS = 3.0  # of the body, around where it is; from no source: as far as a person carries it and says "here"
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
