"""Rovers in MuJoCo on free ground, and the figures of ForestRover that closed forms are made of."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

from tests.simhal.clearing import STEADY
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.mujoco.model import STEP_S
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING, Forest, Trunk
from wayfarer.simhal.world.physics import Physics, Terrain
from wayfarer.simhal.world.wheeled_body import ROLLING_RESISTANCE, body_of

CONFIG = load_rover("forestrover")
BODY = body_of("forestrover", CONFIG.vehicle, CONFIG.chassis, "a test")
A_M, B_M, RADIUS_M = BODY.wheels
WEIGHT_N = BODY.weight_kg * STANDARD_GRAVITY_M_S2
STALL_N = BODY.motors_n_m / RADIUS_M  # of all motors, at the rims
RESISTANCE_N = ROLLING_RESISTANCE * WEIGHT_N
MOVED_KG = BODY.weight_kg + BODY.rims_kg


def rover_on(
    friction: float,
    torque_scale: float = 1.0,
    forest: Forest = CLEARING,
    roughness_m: float = 0.0,
    physics: Physics = STEADY,
    step_s: float = STEP_S,
) -> MujocoWorld:
    return MujocoWorld(forest, BODY, physics, Terrain(friction, roughness_m, torque_scale), RandomStreams(0), step_s)


def on_free_ground(config: RoverConfig, friction: float, torque_scale: float = 1.0) -> MujocoWorld:
    body = body_of(config.name, config.vehicle, config.chassis, "a test")
    return MujocoWorld(CLEARING, body, STEADY, Terrain(friction, 0.0, torque_scale), RandomStreams(0))


def drive(world: MujocoWorld, left: float, right: float, for_s: float) -> None:
    world.command(left, right)
    world.advance_to(world.t_s + for_s)


def speed_m_s(world: MujocoWorld) -> float:
    """Ahead, over the next tenth of a second."""
    before_m, before_s = world.forward_m - world.reverse_m, world.t_s
    world.advance_to(world.t_s + 0.1)
    return (world.forward_m - world.reverse_m - before_m) / (world.t_s - before_s)


def trunk_across(y_m: float, diameter_m: float = 0.3) -> Forest:
    trunk = Trunk(21.0, y_m, 29.0, y_m, "across")
    return replace(CLEARING, trunks=(trunk,), trunk_diameter_m=diameter_m)


def tree_at(x_m: float, y_m: float) -> Forest:
    return replace(CLEARING, trees_m=((x_m, y_m),))


def least_turning_duty(friction: float) -> float:
    """The duty of both sides, opposed, from which the body turns on the spot.

    Each wheel carries a quarter of the weight and slides along a circle around its own foot point: friction opposes
    that, and the share of it that the motor must overcome is a over the wheel's distance from the middle. This is the
    moment of friction of Mandow (2007) and Pentzer (2014) for wheels that touch the ground in points.
    """
    return (friction * WEIGHT_N * A_M / hypot(A_M, B_M) + RESISTANCE_N) / STALL_N
