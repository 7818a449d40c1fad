"""Appearance of the rover: a box with a visible nose, and wheels whose rotation is visible.

Sizes are those of the physics' ``WheeledBody``; what is added to that (mast, lamps, colours) is for the eye. Nothing
here can touch anything.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import mujoco

from wayfarer.simhal.mujoco.model import ROVER
from wayfarer.simhal.world.wheeled_body import WheeledBody

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
ACROSS = (2**-0.5, 2**-0.5, 0.0, 0.0)  # the quaternion that lays a cylinder's axis along y


def add_rover(spec: Any, body: WheeledBody) -> None:
    """Add the rover with the same joints in the same order as ``model.build_model``, so that its poses fit."""
    rover = spec.worldbody.add_body(name=ROVER)
    rover.add_freejoint()
    _add_hull(rover, body)
    half_base_m, half_track_m, _ = body.wheels
    for ahead, left in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        wheel = rover.add_body(pos=(ahead * half_base_m, left * half_track_m, 0.0))
        wheel.add_joint(axis=(0.0, 1.0, 0.0))
        _add_wheel(wheel, body, left)


def _show(body: Any, kind: Any, size: tuple[float, float, float], rgba: tuple[float, ...], **where: Any) -> None:
    """Add a geom that is seen and weighs something, and meets nothing."""
    plain = {"contype": 0, "conaffinity": 0, "mass": 0.1, "material": "paint"}
    body.add_geom(type=kind, size=size, rgba=rgba, **plain | where)


def _add_hull(rover: Any, body: WheeledBody) -> None:
    """Add a tub between the wheels, a wider shell above them, and what stands on it."""
    half_base_m, _, radius_m = body.wheels
    belly_m, top_m = body.clearance_m - radius_m, body.height_m - radius_m
    long_m = half_base_m + 0.5 * radius_m
    tub_m, wide_m = body.width_m / 2.0 - 1.1 * body.tyre_width_m, body.width_m / 2.0 - 0.2 * body.tyre_width_m
    rail_m = min(0.8 * radius_m + 0.012, top_m - 0.03)  # the shell begins above the wheels' upper half
    middle_m = (rail_m + top_m) / 2.0
    _show(rover, BOX, (long_m, tub_m, (rail_m - belly_m) / 2.0), DECK, pos=(0.0, 0.0, (belly_m + rail_m) / 2.0))
    _show(rover, BOX, (long_m, wide_m, (middle_m - rail_m) / 2.0), SHELL, pos=(0.0, 0.0, (rail_m + middle_m) / 2.0))
    roof_m = (top_m - middle_m) / 2.0
    _show(rover, BOX, (0.8 * long_m, 0.8 * wide_m, roof_m), SHELL, pos=(-0.06 * long_m, 0.0, middle_m + roof_m))
    _show(rover, BOX, (0.5 * long_m, 0.6 * wide_m, 0.004), DECK, pos=(-0.25 * long_m, 0.0, top_m))
    _add_nose(rover, long_m, wide_m, rail_m, middle_m, top_m)
    for left in (1, -1):
        tail_m = (-long_m, left * 0.75 * wide_m, 0.5 * (rail_m + middle_m))
        _show(rover, BOX, (0.004, 0.12 * wide_m, 0.012), TAIL_LAMP, pos=tail_m)
    mast_m, ahead_m, left_m = 0.5 * top_m + 0.3 * long_m, -0.7 * long_m, 0.4 * wide_m
    mast = (0.026 * long_m, mast_m / 2.0, 0.0)
    _show(rover, CYLINDER, mast, METAL, pos=(ahead_m, left_m, top_m + mast_m / 2.0))
    _show(rover, CYLINDER, (0.115 * long_m, 0.008, 0.0), NOSE, pos=(ahead_m, left_m, top_m + mast_m))


def _add_nose(rover: Any, long_m: float, wide_m: float, rail_m: float, middle_m: float, top_m: float) -> None:
    """Add a white bumper, lamps, and a white arrow on the roof that points ahead."""
    _show(rover, BOX, (0.008, wide_m, 0.014), NOSE, pos=(long_m + 0.004, 0.0, rail_m))
    for left in (1, -1):
        lamp_m = (long_m + 0.004, left * 0.7 * wide_m, (rail_m + middle_m) / 2.0 + 0.008)
        _show(rover, SPHERE, (0.09 * long_m, 0.0, 0.0), LAMP, material="lamp", pos=lamp_m)
        turn, arrow_m = left * -0.35 * pi + 0.5 * pi, (0.56 * long_m, left * 0.20 * wide_m, top_m + 0.002)
        across = (cos(turn / 2.0), 0.0, 0.0, sin(turn / 2.0))
        _show(rover, BOX, (0.010, 0.30 * wide_m, 0.003), NOSE, pos=arrow_m, quat=across)


def _add_wheel(wheel: Any, body: WheeledBody, left: int) -> None:
    """Add a tyre with lugs, and a rim with spokes on its outer side."""
    radius_m, half_m = body.wheel_radius_m, body.tyre_width_m / 2.0
    _show(wheel, CYLINDER, (0.93 * radius_m, 0.9 * half_m, 0.0), RUBBER, quat=ACROSS)
    for lug in range(LUGS):
        turn, slant_m, out_m = 2.0 * pi * lug / LUGS, (lug % 2 - 0.5) * 0.8 * half_m, 0.90 * radius_m
        size = (0.05 * radius_m, 0.6 * half_m, 0.10 * radius_m)
        _show(wheel, BOX, size, LUG, **_round_the_axle(turn, out_m, slant_m))
    side_m = left * 0.92 * half_m
    _show(wheel, CYLINDER, (0.60 * radius_m, 0.003, 0.0), DECK, pos=(0.0, side_m, 0.0), quat=ACROSS)
    _show(wheel, CYLINDER, (0.20 * radius_m, 0.008, 0.0), METAL, pos=(0.0, side_m, 0.0), quat=ACROSS)
    for spoke in range(SPOKES):
        turn, size = 2.0 * pi * spoke / SPOKES, (0.07 * radius_m, 0.006, 0.28 * radius_m)
        _show(wheel, BOX, size, METAL, **_round_the_axle(turn, 0.34 * radius_m, side_m))


def _round_the_axle(turn: float, out_m: float, side_m: float) -> dict[str, tuple[float, ...]]:
    """Return place and attitude of what stands so far out from a wheel's axle."""
    quat = (cos(turn / 2.0), 0.0, sin(turn / 2.0), 0.0)
    return {"pos": (out_m * sin(turn), side_m, out_m * cos(turn)), "quat": quat}
