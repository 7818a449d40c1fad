"""Appearance of the rover: a box with a visible nose, and wheels whose rotation is visible.

Sizes are those of the physics' ``WheeledBody``; what is added to that (mast, lamps, colours) is for the eye.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import mujoco

from wayfarer.simhal.world.wheeled_body import WheeledBody

Colour = tuple[float, float, float, float]
Pair = tuple[float, float]  # ahead and to the left

SHELL = (0.93, 0.42, 0.06, 1.0)  # the orange of rescue gear
DECK = (0.13, 0.14, 0.15, 1.0)
NOSE = (0.96, 0.96, 0.92, 1.0)
RUBBER = (0.075, 0.075, 0.08, 1.0)
LUG = (0.15, 0.15, 0.155, 1.0)
METAL = (0.72, 0.73, 0.75, 1.0)
LAMP = (1.0, 0.97, 0.80, 1.0)
TAIL_LAMP = (0.80, 0.05, 0.04, 1.0)

LUGS = 14  # round each tyre
SPOKES = 5

BOX, CYLINDER = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE


def add_looks(rover: Any, body: WheeledBody) -> None:
    """Add what is seen to the body and the wheels of a model by ``build_spec``."""
    _add_hull(rover, body)
    for wheel, left in zip(rover.bodies, (1, 1, -1, -1), strict=True):
        _add_wheel(wheel, body, left)


def _add_hull(rover: Any, body: WheeledBody) -> None:
    """Add a tub between the wheels, a wider shell above them, and what stands on it."""
    half_base_m, _, radius_m = body.wheels
    belly_m, top_m = body.clearance_m - radius_m, body.height_m - radius_m
    long_m = half_base_m + 0.5 * radius_m
    tub_m, wide_m = body.width_m / 2.0 - 1.1 * body.tyre_width_m, body.width_m / 2.0 - 0.2 * body.tyre_width_m
    rail_m = min(0.8 * radius_m + 0.012, top_m - 0.03)  # the shell begins above the wheels' upper half
    middle_m = (rail_m + top_m) / 2.0
    lamps_m = (rail_m + middle_m) / 2.0

    def box(colour: Colour, at_m: Pair, half_m: Pair, low_m: float, high_m: float) -> None:
        pos, size = (*at_m, (low_m + high_m) / 2.0), (*half_m, (high_m - low_m) / 2.0)
        rover.add_geom(type=BOX, pos=pos, size=size, rgba=colour, material="paint")

    box(DECK, (0.0, 0.0), (long_m, tub_m), belly_m, rail_m)
    box(SHELL, (0.0, 0.0), (long_m, wide_m), rail_m, middle_m)
    box(SHELL, (-0.06 * long_m, 0.0), (0.8 * long_m, 0.8 * wide_m), middle_m, top_m)
    box(DECK, (-0.25 * long_m, 0.0), (0.5 * long_m, 0.6 * wide_m), top_m - 0.004, top_m + 0.004)
    box(NOSE, (long_m + 0.004, 0.0), (0.008, wide_m), rail_m - 0.014, rail_m + 0.014)
    for left in (1, -1):
        box(TAIL_LAMP, (-long_m, left * 0.75 * wide_m), (0.004, 0.12 * wide_m), lamps_m - 0.012, lamps_m + 0.012)
        lamp_m = (long_m + 0.004, left * 0.7 * wide_m, lamps_m + 0.008)
        rover.add_geom(type=SPHERE, pos=lamp_m, size=(0.09 * long_m, 0.0, 0.0), rgba=LAMP, material="lamp")
        # A half of the white arrow on the roof, which points ahead.
        turn, arrow_m = (0.5 - left * 0.35) * pi, (0.56 * long_m, left * 0.20 * wide_m, top_m + 0.002)
        rover.add_geom(
            type=BOX, pos=arrow_m, size=(0.010, 0.30 * wide_m, 0.003), rgba=NOSE, material="paint",
            quat=(cos(turn / 2.0), 0.0, 0.0, sin(turn / 2.0)),
        )  # fmt: skip
    mast_m = (-0.7 * long_m, 0.4 * wide_m, top_m)
    dish_m = (*mast_m[:2], 1.5 * top_m + 0.3 * long_m)
    _add_cylinder(rover, METAL, 0.026 * long_m, (*mast_m, *dish_m))
    _add_cylinder(rover, NOSE, 0.115 * long_m, (*dish_m[:2], dish_m[2] - 0.008, *dish_m[:2], dish_m[2] + 0.008))


def _add_wheel(wheel: Any, body: WheeledBody, left: int) -> None:
    """Add a tyre with lugs, and a rim with spokes on its outer side."""
    radius_m, half_m = body.wheel_radius_m, body.tyre_width_m / 2.0
    side_m = left * 0.92 * half_m
    for colour, radius, middle_m, half_wide_m in (
        (RUBBER, 0.93, 0.0, 0.9 * half_m),
        (DECK, 0.60, side_m, 0.003),
        (METAL, 0.20, side_m, 0.008),
    ):
        ends_m = (0.0, middle_m - half_wide_m, 0.0, 0.0, middle_m + half_wide_m, 0.0)
        _add_cylinder(wheel, colour, radius * radius_m, ends_m)
    for lug in range(LUGS):
        along_m, size = (lug % 2 - 0.5) * 0.8 * half_m, (0.05 * radius_m, 0.6 * half_m, 0.10 * radius_m)
        _add_round_the_axle(wheel, LUG, lug / LUGS, along_m, 0.90 * radius_m, size)
    for spoke in range(SPOKES):
        size = (0.07 * radius_m, 0.006, 0.28 * radius_m)
        _add_round_the_axle(wheel, METAL, spoke / SPOKES, side_m, 0.34 * radius_m, size)


def _add_cylinder(body: Any, colour: Colour, radius_m: float, ends_m: tuple[float, ...]) -> None:
    body.add_geom(type=CYLINDER, fromto=ends_m, size=(radius_m, 0.0, 0.0), rgba=colour, material="paint")


def _add_round_the_axle(
    wheel: Any, colour: Colour, turns: float, along_m: float, out_m: float, size: tuple[float, float, float]
) -> None:
    """Add a box so many turns round the axle, so far along it and out from it."""
    turn = 2.0 * pi * turns
    wheel.add_geom(
        type=BOX, pos=(out_m * sin(turn), along_m, out_m * cos(turn)), size=size, rgba=colour, material="paint",
        quat=(cos(turn / 2.0), 0.0, sin(turn / 2.0), 0.0),
    )  # fmt: skip
