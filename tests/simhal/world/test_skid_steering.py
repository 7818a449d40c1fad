"""Physics-light on ground of a given friction, against closed forms."""

from __future__ import annotations

from math import hypot, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.clearing import STEADY, world_on_ground
from wayfarer.config.rover_file import load_rover
from wayfarer.config.settings import STANDARD_GRAVITY_M_S2
from wayfarer.simhal.world.physics import FRICTIONS, GroundName
from wayfarer.simhal.world.wheeled_body import ROLLING_RESISTANCE, body_of

CONFIG = load_rover("forestrover")
VEHICLE = CONFIG.vehicle
BODY = body_of("forestrover", VEHICLE, CONFIG.chassis, "a test")
A_M, B_M, RADIUS_M = BODY.wheels
WEIGHT_N = BODY.weight_kg * STANDARD_GRAVITY_M_S2
STALL_N = BODY.motors_n_m / RADIUS_M
LONG_S = 4.0

duties = st.floats(-1.0, 1.0)
grounds = st.sampled_from(sorted(FRICTIONS.values()))


def settled(friction: float, left: float, right: float) -> tuple[float, float]:
    """Speed ahead, m/s, and turn rate, rad/s."""
    world = world_on_ground(CONFIG, friction)
    world.command(left, right)
    world.advance_to(LONG_S)
    from_m, from_rad = world.forward_m - world.reverse_m, world.heading_rad
    world.advance_to(LONG_S + 0.5)
    return 2.0 * (world.forward_m - world.reverse_m - from_m), 2.0 * (world.heading_rad - from_rad)


def least_difference(friction: float) -> float:
    """Half the difference of duties below which friction holds the body: see ``skid_steering``."""
    return friction * WEIGHT_N * A_M / hypot(A_M, B_M) / STALL_N


@pytest.mark.parametrize("friction", FRICTIONS.values())
def test_turns_on_the_spot_from_the_duty_of_the_closed_form(friction: float) -> None:
    least = least_difference(friction) + ROLLING_RESISTANCE * WEIGHT_N / STALL_N
    assert settled(friction, least - 0.01, 0.01 - least) == (0.0, 0.0)
    _, turn_rad_s = settled(friction, least + 0.02, -0.02 - least)
    assert turn_rad_s == pytest.approx(VEHICLE.max_speed_m_s * 0.02 / (B_M + A_M**2 / B_M), rel=0.05)


@given(friction=grounds, mean=st.floats(-0.6, 0.6), share=st.floats(-0.99, 0.99))
def test_difference_below_the_dead_zone_bends_no_arc(friction: float, mean: float, share: float) -> None:
    half = share * min(least_difference(friction), 1.0 - abs(mean))
    assert settled(friction, mean + half, mean - half)[1] == 0.0


@given(friction=grounds, left=duties, right=duties)
def test_mirrored_and_reversed_duties_drive_mirrored_and_reversed(friction: float, left: float, right: float) -> None:
    speed_m_s, turn_rad_s = settled(friction, left, right)
    assert settled(friction, right, left) == pytest.approx((speed_m_s, -turn_rad_s), abs=1e-9)
    assert settled(friction, -right, -left) == pytest.approx((-speed_m_s, turn_rad_s), abs=1e-9)


@given(friction=grounds, left=duties, right=duties)
def test_friction_takes_and_never_gives(friction: float, left: float, right: float) -> None:
    speed_m_s, turn_rad_s = settled(friction, left, right)
    assert abs(speed_m_s) <= VEHICLE.max_speed_m_s * abs(left + right) / 2.0 + 1e-9
    told_rad_s = VEHICLE.max_speed_m_s * (left - right) / (2.0 * B_M)
    assert 0.0 <= turn_rad_s * told_rad_s <= told_rad_s**2 + 1e-9
    assert abs(speed_m_s * turn_rad_s) <= friction * STANDARD_GRAVITY_M_S2 * (1.0 + 1e-6)


@given(friction=grounds, commands=st.lists(st.tuples(duties, duties), min_size=1, max_size=12))
def test_no_side_gains_speed_faster_than_its_wheels_grip(friction: float, commands: list[tuple[float, float]]) -> None:
    world, speed_m_s = world_on_ground(CONFIG, friction), 0.0
    for left, right in commands:
        world.command(left, right)
        for _ in range(5):
            gone_m = world.forward_m - world.reverse_m
            world.advance_to(world.t_s + STEADY.step_s)
            now_m_s = (world.forward_m - world.reverse_m - gone_m) / STEADY.step_s
            assert abs(now_m_s - speed_m_s) <= friction * STANDARD_GRAVITY_M_S2 * STEADY.step_s + 1e-9
            speed_m_s = now_m_s


@given(friction=grounds, left=duties, right=duties)
def test_body_without_duty_comes_to_rest(friction: float, left: float, right: float) -> None:
    world = world_on_ground(CONFIG, friction)
    world.command(left, right)
    world.advance_to(2.0)
    world.command(0.0, 0.0)
    world.advance_to(4.5)
    at_rest = world.x_m, world.y_m, world.heading_rad
    world.advance_to(5.0)
    assert (world.x_m, world.y_m, world.heading_rad) == at_rest


def test_spinning_wheels_start_with_the_friction_of_the_ground() -> None:
    mud = FRICTIONS[GroundName.mud]
    world = world_on_ground(CONFIG, mud)
    world.command(1.0, 1.0)
    world.advance_to(0.5)
    gone_m = world.forward_m
    world.advance_to(0.55)
    assert (world.forward_m - gone_m) / 0.05 == pytest.approx(mud * STANDARD_GRAVITY_M_S2 * 0.55, rel=0.02)


def test_dead_side_is_dragged_and_the_body_goes_round_it() -> None:
    world = world_on_ground(CONFIG, FRICTIONS[GroundName.mud])
    world.set_faults(right_gain=0.0)
    world.command(0.5, 0.5)
    world.advance_to(2.0)
    assert world.heading_rad > radians(45.0)
