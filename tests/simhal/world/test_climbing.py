"""How a rover meets a branch: over a low one, stopped by a thick one, sometimes onto it; and who helps it then."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import degrees

import pytest

from tests.simhal.clearing import STEADY
from wayfarer.config.rover_file import load_rover
from wayfarer.config.settings import CLIMBING_KEYS, Chassis
from wayfarer.experiments.outcome import InterventionCounter
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.collision import BodyOutline, obstacles_of
from wayfarer.simhal.world.forest import Forest, Trunk
from wayfarer.simhal.world.wheeled_body import Climbing
from wayfarer.simhal.world.world import World

ROVER = load_rover("forestrover")
START_Y_M = 20.0


def branch_ahead(diameter_m: float) -> Forest:
    branch = Trunk(24.0, START_Y_M + 1.0, 26.0, START_Y_M + 1.0, "across")
    return Forest(0, 0, (25.0, START_Y_M), 0.0, 30.0, 0.3, 0.25, (branch,), (), diameters_m=(diameter_m,))


def world_of(diameter_m: float, *, stronger: float = 1.0, seed: int = 0) -> World:
    torque_n_m = ROVER.chassis.motors_n_m
    assert torque_n_m is not None
    chassis = replace(ROVER.chassis, motors_n_m=torque_n_m * stronger)
    return World(branch_ahead(diameter_m), ROVER.vehicle, STEADY, RandomStreams(seed), chassis=chassis)


def steps(world: World, seconds: float, duty: float = 0.3) -> Iterator[World]:
    world.command(duty, duty)
    for _ in range(round(seconds / 0.05)):
        world.advance_to(world.t_s + 0.05)
        yield world


def test_branch_lower_than_the_belly_is_driven_over_with_a_bump() -> None:
    world = world_of(0.04)
    bumps_deg = [seen.attitude()[1] - seen.pitch_deg for seen in steps(world, 6.0)]
    assert world.y_m > START_Y_M + 2.0
    assert max(bumps_deg) == pytest.approx(5.0, abs=1.5)
    assert min(bumps_deg) == pytest.approx(-5.0, abs=1.5)
    assert bumps_deg.index(max(bumps_deg)) < bumps_deg.index(min(bumps_deg))
    assert bumps_deg[0] == bumps_deg[-1] == 0.0


def test_thicker_branch_stops_the_rover_and_lifts_its_nose() -> None:
    world = world_of(0.2)
    pitches_deg = [seen.pitch_deg for seen in steps(world, 4.0)]
    assert world.y_m < START_Y_M + 1.0
    assert max(pitches_deg) > 1.0
    assert world.attitude()[1] == world.pitch_deg


def test_without_a_chassis_every_branch_is_a_trunk() -> None:
    world = World(branch_ahead(0.02), ROVER.vehicle, STEADY, RandomStreams(0))
    list(steps(world, 4.0))
    assert world.y_m < START_Y_M + 1.0


@pytest.mark.parametrize(("rover", "strength"), [("forestrover", 0.345), ("minirover", 0.239)])
def test_strength_follows_from_the_papers_table(rover: str, strength: float) -> None:
    config = load_rover(rover)
    climbing = Climbing(config.vehicle, config.chassis, STEADY, RandomStreams(0))
    assert climbing.strength == pytest.approx(strength, rel=0.01)


def test_chassis_with_a_gap_says_which() -> None:
    assert Chassis(ground_clearance_m=0.1).missing(CLIMBING_KEYS) == ("weight_kg", "motors_n_m")
    with pytest.raises(ValueError, match="weight_kg, motors_n_m"):
        Climbing(ROVER.vehicle, Chassis(ground_clearance_m=0.1), STEADY, RandomStreams(0))


def test_faster_rover_is_lifted_higher_at_contact() -> None:
    climbing = Climbing(ROVER.vehicle, ROVER.chassis, STEADY, RandomStreams(0))
    lifts_deg = [climbing.meet(speed_m_s) for speed_m_s in (0.0, 0.42, 1.4, 100.0)]
    assert lifts_deg == sorted(lifts_deg)
    assert lifts_deg[0] == 0.0
    assert lifts_deg[1] == pytest.approx(2.4, abs=0.1)  # 0.42 squared over g is 18 mm, of 437 mm
    assert lifts_deg[-1] == 90.0


def test_rover_that_climbs_a_branch_is_off_its_wheels_and_is_helped() -> None:
    world, seen = world_of(0.06, stronger=20.0), []
    intervention_counter = InterventionCounter(
        STEADY.tip_deg, lambda at: seen.append((at.y_m, at.pitch_deg, at.high_centred))
    )
    world.after_step = intervention_counter.watch
    list(steps(world, 4.0))
    assert intervention_counter.high_centred > 0
    assert intervention_counter.flips == 0
    assert intervention_counter.interventions == intervention_counter.high_centred
    assert not any(high_centred for _, _, high_centred in seen)  # put back before the outcome monitor looks


def test_overturned_rover_is_put_back_level_near_by_with_the_same_heading() -> None:
    world = world_of(0.3, stronger=2000.0)
    intervention_counter = InterventionCounter(STEADY.tip_deg, lambda _: None)
    for _ in steps(world, 6.0):
        before_m = world.y_m
        intervention_counter.watch(world)
        if intervention_counter.flips:
            break
    assert intervention_counter.flips == 1
    assert (world.pitch_deg, world.high_centred, degrees(world.heading_rad)) == (0.0, False, 0.0)
    assert before_m - 0.16 < world.y_m < before_m - 0.05


def test_rover_is_not_put_back_into_what_is_behind_it() -> None:
    world = world_of(0.3)
    forest = branch_ahead(0.3)
    list(steps(world, 4.0))
    body, (branch,) = BodyOutline(ROVER.vehicle.length_m, ROVER.vehicle.width_m), obstacles_of(forest)
    world.carry_to(25.0, START_Y_M + 1.0 + 0.15 + 0.2186 + 0.05, 0.0)  # 50 mm beyond the branch
    world.pull_back(0.15)
    assert not body.overlaps(branch, world.x_m, world.y_m, 0.0, 1.0)
    assert world.y_m > START_Y_M + 1.0 + 0.15 + 0.2185


def test_grip_is_a_chance_of_its_own() -> None:
    pitches = {max(seen.pitch_deg for seen in steps(world_of(0.3, seed=seed), 3.0)) for seed in range(4)}
    assert len(pitches) == 4
