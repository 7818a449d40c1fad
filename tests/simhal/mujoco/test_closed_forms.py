"""The world in MuJoCo against what is known of such bodies: each test works its figure out by hand.

Tyres give way by some 3 mm, 4 % of the wheel's radius; that is what most of the tolerances are for.
"""

from __future__ import annotations

from math import atan, cos, degrees, exp, hypot, pi, sin, tan

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq

from tests.simhal.mujoco.fields import (
    A_M,
    B_M,
    BODY,
    MOVED_KG,
    RADIUS_M,
    RESISTANCE_N,
    STALL_N,
    WEIGHT_N,
    drive,
    least_turning_duty,
    rover_on,
    speed_m_s,
    tree_at,
    trunk_across,
)
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.world.wheeled_body import WHEEL_SHARE_OF_WEIGHT

FREE_M_S = BODY.free_speed_m_s
NO_SLIP = 2.0  # a friction at which nothing slips in these tests


@pytest.mark.parametrize("duty", [1.0, 0.5, -0.5])
def test_rolling_speed_is_the_free_speed_less_what_resistance_takes(duty: float) -> None:
    world = rover_on(0.8)
    drive(world, duty, duty, 3.0)
    expected_m_s = FREE_M_S * (abs(duty) - RESISTANCE_N / STALL_N)
    assert abs(speed_m_s(world)) == pytest.approx(expected_m_s, rel=0.04)


def test_gaining_speed_takes_the_time_constant_of_motors_and_mass() -> None:
    world, duty = rover_on(NO_SLIP), 0.2
    time_constant_s = MOVED_KG * FREE_M_S / STALL_N
    drive(world, duty, duty, time_constant_s)
    expected_m_s = FREE_M_S * (duty - RESISTANCE_N / STALL_N) * (1.0 - exp(-1.0))
    assert world.data.qvel[1] == pytest.approx(expected_m_s, rel=0.05)


def test_spinning_wheels_push_with_the_grip_of_the_ground() -> None:
    world = rover_on(0.1)
    drive(world, 1.0, 1.0, 0.2)
    assert world.slipping
    before_m_s = world.data.qvel[1]
    drive(world, 1.0, 1.0, 0.4)
    assert (world.data.qvel[1] - before_m_s) / 0.4 == pytest.approx(0.1 * STANDARD_GRAVITY_M_S2, rel=0.03)


@pytest.mark.parametrize("friction", [0.15, 0.3])
def test_braking_distance_on_sliding_wheels(friction: float) -> None:
    world = rover_on(friction)
    drive(world, 1.0, 1.0, 6.0)
    from_m_s, from_m = float(world.data.qvel[1]), world.forward_m
    world.command(-1.0, -1.0)
    while world.data.qvel[1] > 0.0:
        world.advance_to(world.t_s + 0.004)
    expected_m = from_m_s**2 / (2.0 * friction * STANDARD_GRAVITY_M_S2)
    assert world.forward_m - from_m == pytest.approx(expected_m, rel=0.03)


def force_on_obstacle_n(world: MujocoWorld) -> float:
    """Horizontal, a mean over a second; the obstacle is geom 1."""
    forces_n, of_contact = [], np.zeros(6)
    for _ in range(50):
        world.advance_to(world.t_s + 0.02)
        total = np.zeros(3)
        for index in range(world.data.ncon):
            contact = world.data.contact[index]
            if 1 in contact.geom:
                mujoco.mj_contactForce(world.model, world.data, index, of_contact)
                total += contact.frame.reshape(3, 3).T @ of_contact[:3]
        forces_n.append(hypot(total[0], total[1]))
    return float(np.mean(forces_n))


@pytest.mark.parametrize(("friction", "torque_scale"), [(0.15, 1.0), (0.15, 3.0), (0.8, 0.5), (0.5, 0.3)])
def test_force_at_a_tree_is_that_of_the_motors_or_of_the_grip(friction: float, torque_scale: float) -> None:
    world = rover_on(friction, torque_scale, tree_at(25.0, 13.4))
    drive(world, 1.0, 1.0, 4.0)
    expected_n = min(torque_scale * STALL_N, friction * WEIGHT_N)
    assert force_on_obstacle_n(world) == pytest.approx(expected_n, rel=0.08)


def turn_rate_deg_s(friction: float, duty: float) -> float:
    world = rover_on(friction)
    drive(world, duty, -duty, 2.0)
    return degrees(-world.data.qvel[5])


@pytest.mark.parametrize("friction", [0.15, 0.3, 0.5, 0.8])
def test_body_turns_on_the_spot_where_the_motors_overcome_the_moment_of_friction(friction: float) -> None:
    least = least_turning_duty(friction)
    assert turn_rate_deg_s(friction, 0.93 * least) < 1.0
    assert turn_rate_deg_s(friction, 1.07 * least) > 1.5
    # Beyond that the rims go round at what is left of the speed, and slip as the wheels' place on the circle says.
    duty = 1.3 * least
    expected_deg_s = degrees(FREE_M_S * (duty - least) / (B_M + A_M**2 / B_M))
    assert turn_rate_deg_s(friction, duty) == pytest.approx(expected_deg_s, rel=0.06)


def thickest_climbed_m(friction: float) -> float:
    """The diameter of the thickest trunk onto which four driven wheels lift the front axle.

    The front wheel's contact lies at an angle from the vertical; both axles push with all their grip. Forces and
    moments about the rear contact leave one angle, and that angle one diameter for a wheel of this radius.
    """

    def lacking(angle: float) -> float:
        pushed_back, held_up = sin(angle) - friction * cos(angle), cos(angle) + friction * sin(angle)
        front_n = WEIGHT_N / (pushed_back / friction + held_up)
        reach_m, height_m = 2.0 * A_M + RADIUS_M * sin(angle), RADIUS_M * (1.0 - cos(angle))
        return float(front_n * (held_up * reach_m + pushed_back * height_m) - WEIGHT_N * A_M)

    angle = brentq(lacking, atan(friction) + 1e-6, pi / 2)
    return 2.0 * RADIUS_M * tan(angle / 2.0) ** 2


def climbs(friction: float, diameter_m: float) -> bool:
    """Whether the front axle gets over, at a crawl and with motors that do not stall."""
    world = rover_on(friction, 20.0, trunk_across(13.0, diameter_m))
    drive(world, 0.06, 0.06, 8.0)
    return bool(world.y_m > 13.0 - A_M + 0.02)


@pytest.mark.parametrize("friction", [0.3, 0.5])
def test_climbing_height_within_what_the_tyre_gives_way(friction: float) -> None:
    thickest_m = thickest_climbed_m(friction)
    assert climbs(friction, thickest_m - 0.002)
    assert not climbs(friction, thickest_m + 0.007)


@pytest.mark.parametrize(("slope", "half_base_m"), [("ground_roll_deg", B_M), ("ground_pitch_deg", A_M)])
def test_body_tips_where_its_weight_passes_the_wheels(slope: str, half_base_m: float) -> None:
    world = rover_on(NO_SLIP, torque_scale=20.0)
    wheels = 4.0 * WHEEL_SHARE_OF_WEIGHT
    centre_of_mass_m = wheels * RADIUS_M + (1.0 - wheels) * (BODY.clearance_m + BODY.height_m) / 2.0
    expected_deg = degrees(atan(half_base_m / centre_of_mass_m))
    for angle_deg in np.arange(expected_deg - 8.0, expected_deg + 8.0, 0.2):
        setattr(world, slope, float(angle_deg))
        world.advance_to(world.t_s + 0.2)
        if abs(world.pitch_deg) + abs(world.roll_deg) > 8.0:  # beyond the slope itself, which the sensors add
            break
    assert angle_deg == pytest.approx(expected_deg, abs=1.5)


@pytest.mark.parametrize(("friction", "holds"), [(0.4, False), (0.55, True)])
def test_body_slides_sideways_where_the_slope_is_steeper_than_the_grip(friction: float, holds: bool) -> None:
    world = rover_on(friction)
    world.ground_roll_deg = 25.0  # a grip of 0.466
    world.advance_to(3.0)
    assert (abs(world.right_m) < 0.02) is holds
    assert world.right_m >= 0.0


def test_half_the_time_step_takes_the_same_way() -> None:
    """Duties of every kind on slippery ground, against a trunk, for 12 s."""
    ends = []
    for step_s in (0.004, 0.002):
        world = rover_on(0.3, forest=trunk_across(16.0), step_s=step_s)
        for left, right in ((0.6, 0.6), (0.6, -0.6), (-0.4, -0.4), (0.7, 0.2)):
            drive(world, left, right, 3.0)
        ends.append((world.x_m, world.y_m, world.forward_m, world.reverse_m))
    assert ends[0] == pytest.approx(ends[1], abs=0.05)
