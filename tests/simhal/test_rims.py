"""How the wheels of a simulated body turn, and what load their motors have, beside what the body does."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.simhal.clearing import STEADY
from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING, Trunk
from wayfarer.simhal.world.rims import SLIP_FRICTION
from wayfarer.simhal.world.skid_steering import SkidSteering
from wayfarer.simhal.world.wheeled_body import body_of
from wayfarer.simhal.world.world import World

CONFIG = load_rover("forestrover")
BODY = body_of("forestrover", CONFIG.vehicle, CONFIG.chassis, "a test")
PER_FRICTION = BODY.weight_kg * 9.80665 * BODY.wheel_radius_m / BODY.motors_n_m  # of the stall force
TRUNK_AHEAD = replace(CLEARING, trunks=(Trunk(20.0, 14.0, 30.0, 14.0, "across"),))


def world_on(friction: float | None, trunk: bool = False) -> World:
    skid = None if friction is None else SkidSteering(BODY, friction, CONFIG.vehicle.track_m, STEADY.step_s)
    world = World(TRUNK_AHEAD if trunk else CLEARING, CONFIG.vehicle, STEADY, RandomStreams(0), skid=skid)
    world.wheeled = BODY
    return world


def drive(world: World, left: float, right: float, for_s: float) -> tuple[float, float]:
    """Return how far the rims turned."""
    before = world.rims_m
    world.command(left, right)
    world.advance_to(world.t_s + for_s)
    return world.rims_m[0] - before[0], world.rims_m[1] - before[1]


@pytest.mark.parametrize("friction", [None, 0.15, 0.4, 0.65])
@pytest.mark.parametrize("duty", [0.5, 1.0, -0.5])
def test_rims_of_a_free_body_turn_as_the_ground_passes_at_a_small_load(friction: float | None, duty: float) -> None:
    world = world_on(friction)
    drive(world, duty, duty, 3.0)
    before_m = world.forward_m - world.reverse_m
    assert sum(drive(world, duty, duty, 1.0)) / 2 == pytest.approx(
        world.forward_m - world.reverse_m - before_m, rel=0.01
    )
    assert max(world.motor_load) < 0.1


@pytest.mark.parametrize("friction", [0.15, 0.4, 0.65])
@pytest.mark.parametrize("duty", [0.1, 0.3, 0.5, 0.8, 1.0])
def test_held_body_stalls_its_wheels_below_their_grip_and_spins_them_above(friction: float, duty: float) -> None:
    world = world_on(friction, trunk=True)
    drive(world, 0.3, 0.3, 8.0)
    assert world.touch is not None
    ways_m = drive(world, duty, duty, 1.0)
    grip = friction * PER_FRICTION
    assert world.motor_load == pytest.approx((min(duty, grip),) * 2)
    assert sum(ways_m) / 2 == pytest.approx(max(duty - grip, 0.0) * BODY.free_speed_m_s, abs=0.01)


def test_wheels_of_a_body_that_slips_spin_nearly_free() -> None:
    world = world_on(None)
    world.lose_grip()
    spun_m = drive(world, 0.7, 0.7, 1.0)
    assert world.forward_m == 0.0
    assert sum(spun_m) / 2 == pytest.approx((0.7 - SLIP_FRICTION * PER_FRICTION) * BODY.free_speed_m_s, rel=0.05)
    assert max(world.motor_load) < 0.1


def test_turn_on_the_spot_takes_half_the_stall_current_on_dry_soil_and_little_on_mud() -> None:
    def load(friction: float) -> float:
        world = world_on(friction)
        drive(world, 0.5, -0.5, 2.0)
        return max(world.motor_load)

    dry, mud = map(load, (0.65, 0.15))
    assert dry > 3 * mud
    assert dry > 0.6 * 0.5, "of what it takes when it is held"


def test_wheels_that_mud_gives_no_grip_spin_while_the_body_gains_speed() -> None:
    world = world_on(0.15)
    rims_m = sum(drive(world, 1.0, 1.0, 0.5)) / 2
    assert rims_m > 2.0 * world.forward_m
    assert world.motor_load == pytest.approx((0.15 * PER_FRICTION,) * 2)


def test_motor_that_is_reversed_takes_more_than_one_that_is_held() -> None:
    world = world_on(None)
    drive(world, 1.0, 1.0, 2.0)
    drive(world, -1.0, -1.0, STEADY.step_s)
    assert max(world.motor_load) > 1.0


def test_rims_are_counted_from_the_first_question_on() -> None:
    world = world_on(None)
    world.command(1.0, 1.0)
    world.advance_to(2.0)
    assert world.rims_m == (0.0, 0.0)


def test_rover_whose_file_gives_no_body_has_plain_wheels() -> None:
    world = world_on(None, trunk=True)
    world.wheeled = None
    drive(world, 0.5, 0.5, 8.0)
    assert drive(world, 0.5, 0.5, 1.0) == (0.0, 0.0)
    assert world.motor_load == pytest.approx((0.5, 0.5))
