"""Climbing: a rover of known weight and motors drives over a low branch, and may climb a thicker one.

Two mishaps end a climb for a blind rover (paper, section IV-C, "due to inertia, rovers sometimes climbed onto fallen
branches"): it turns over, or the branch is under its belly and its wheels are off the ground.
"""

from __future__ import annotations

from math import asin, atan, degrees, radians, sin
from typing import Final

from wayfarer.angles import clamp
from wayfarer.config.settings import CLIMBING_KEYS, STANDARD_GRAVITY_M_S2, Chassis
from wayfarer.escape.settings import Vehicle
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.collision import BodyOutline, Obstacle, ObstacleGrid, low_trunks_of
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics

CELL_M: Final = 0.5  # of the map of what is underfoot


class Climbing:
    """Models climbing onto a branch.

    ``strength`` is the torque of the motors over the moment of the weight about one axle, which they must overcome to
    lift the other: 0.35 for ForestRover, 0.24 for MiniRover. ``Physics.climb_deg_s`` is how fast a strength of 1 lifts
    it at full duty and average grip. Chosen by us, to be plain: the grip of bark is exponentially distributed,
    one draw a contact (most of it is slippery, sometimes a stub holds), and all the energy of the speed at contact goes
    into lifting the nose.
    """

    def __init__(self, vehicle: Vehicle, chassis: Chassis, physics: Physics, streams: RandomStreams) -> None:
        clearance_m, weight_kg, motors_n_m = chassis.ground_clearance_m, chassis.weight_kg, chassis.motors_n_m
        if clearance_m is None or weight_kg is None or motors_n_m is None:
            raise ValueError(f"the chassis does not give {', '.join(chassis.missing(CLIMBING_KEYS))}")
        self.clearance_m = clearance_m
        self._length_m = vehicle.length_m
        self.strength = motors_n_m / (weight_kg * STANDARD_GRAVITY_M_S2 * vehicle.length_m / 2.0)
        self._deg_s = physics.climb_deg_s * self.strength
        self._next_grip = streams.generator("world.grip").exponential
        self._grip = 1.0

    def meet(self, speed_m_s: float) -> float:
        """Return by how many degrees a rover that runs into a branch is lifted at once; its wheels get a new grip.

        The centre of mass rises half as far as the nose: half v squared is g times half the lift.
        """
        self._grip = float(self._next_grip())
        lift_m = min(speed_m_s * speed_m_s / STANDARD_GRAVITY_M_S2, self._length_m)
        return degrees(asin(lift_m / self._length_m))

    def rate_deg_s(self, duty: float) -> float:
        """Return how fast pushing lifts the nose, or for a negative duty the tail, in degrees a second."""
        return duty * self._deg_s * self._grip

    def is_on(self, obstacle: Obstacle, pitch_deg: float) -> bool:
        """Return whether the body is up so far that the branch is under its belly."""
        return self._length_m * abs(sin(radians(pitch_deg))) >= 2.0 * obstacle.radius_m


class GroundPitch:
    """The branches that pass under the belly: they only tilt the body, nose up, then nose down."""

    def __init__(self, forest: Forest, clearance_m: float, body: BodyOutline) -> None:
        self._body = body
        self._grid = ObstacleGrid(low_trunks_of(forest, clearance_m), body.reach_m, CELL_M)

    def pitch_deg(self, x_m: float, y_m: float, sin_h: float, cos_h: float) -> float:
        """Return the pitch of a body there: a branch lifts the end that it is nearer to, by up to its thickness."""
        half_m, pitch_deg = self._body.half_length_m, 0.0
        for branch in self._grid.near(x_m, y_m):
            if self._body.overlaps(branch, x_m, y_m, sin_h, cos_h):
                near_x, near_y = branch.nearest(x_m, y_m)
                ahead_m = (near_x - x_m) * sin_h + (near_y - y_m) * cos_h
                pitch_deg += degrees(atan(branch.radius_m / half_m)) * clamp(ahead_m / half_m, -1.0, 1.0)
        return pitch_deg
