"""Errors of a flow sensor: a false height, and ground on which it sees nothing; the same at both depths."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from math import exp
from statistics import fmean, pstdev

import pytest

from tests.simhal.clearing import STEADY, VEHICLE
from tests.virtual import virtual
from wayfarer.config.rover_file import load_rover
from wayfarer.hal import MotionReading, WheelCommand
from wayfarer.simhal.build_rover import build
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FLOW_M_PER_COUNT, BlindGround, FlowSensorModel, flow_scale
from wayfarer.simhal.world.forest import CLEARING, WORLD_SIZE_M
from wayfarer.simhal.world.physics import Depth, Physics
from wayfarer.simhal.world.world import World

BLIND = replace(STEADY, blind_share=0.3, blind_quality=0.4)


def world_of(physics: Physics) -> World:
    return World(CLEARING, VEHICLE, physics, RandomStreams(0))


def blind_places(physics: Physics, seed: int = 0, apart_m: float = 0.5) -> set[tuple[float, float]]:
    """Where the sensor sees nothing, of places so far apart all over the world."""
    world = world_of(physics)
    ground = BlindGround(world, RandomStreams(seed))
    places = set()
    for row in range(int(WORLD_SIZE_M / apart_m)):
        for column in range(int(WORLD_SIZE_M / apart_m)):
            world.x_m, world.y_m = (column + 0.5) * apart_m, (row + 0.5) * apart_m
            if ground.is_under():
                places.add((world.x_m, world.y_m))
    return places


def test_blind_ground_has_its_share_in_whole_cells_and_another_place_in_each_trial() -> None:
    places = blind_places(BLIND)
    assert len(places) == pytest.approx(0.3 * (WORLD_SIZE_M / 0.5) ** 2, rel=0.15)
    assert set(places) - set(blind_places(BLIND, seed=1))
    for x_m, y_m in places:
        corner = x_m // 2.0 * 2.0, y_m // 2.0 * 2.0
        assert (corner[0] + 0.25, corner[1] + 1.75) in places


def test_larger_share_adds_blind_cells_to_those_of_a_smaller_one() -> None:
    few, many, all_of_it = (blind_places(replace(BLIND, blind_share=share)) for share in (0.1, 0.3, 1.0))
    assert few < many < all_of_it
    assert len(all_of_it) == (WORLD_SIZE_M / 0.5) ** 2 - 16, "a rover that sees nothing at its start is not armed"
    assert CLEARING.start_m not in {(x_m - 0.25, y_m - 0.25) for x_m, y_m in all_of_it}


def test_place_beyond_the_edge_is_blind_or_not_as_one_within() -> None:
    world = world_of(BLIND)
    ground = BlindGround(world, RandomStreams(0))
    for x_m in (3.0, 11.0, 17.0, 23.0):
        found = []
        for shift_m in (-WORLD_SIZE_M, 0.0, WORLD_SIZE_M):
            world.x_m, world.y_m = x_m + shift_m, 5.0 - shift_m
            found.append(ground.is_under())
        assert len(set(found)) == 1


def readings_over_blind_ground(depth: Depth, quality: float) -> list[tuple[bool, MotionReading]]:
    """Whether the ground was blind, and what was read there, along a straight drive of some 20 m."""

    @virtual
    async def main() -> list[tuple[bool, MotionReading]]:
        config = load_rover("sim")
        world = World(CLEARING, config.vehicle, replace(BLIND, blind_quality=quality), RandomStreams(4))
        rover = build(depth, world, RandomStreams(4), config, asyncio.get_running_loop().time)
        ground, found = BlindGround(world, RandomStreams(4)), []
        assert rover.motion is not None
        for part in (rover.motors, rover.motion):
            await part.open()
        await rover.motion.read()
        for _ in range(300):
            await rover.motors.drive(WheelCommand(1.0, 1.0))
            await asyncio.sleep(0.05)
            reading = await rover.motion.read()
            assert reading is not None
            found.append((ground.is_under(), reading))
        return found

    return main()


@pytest.mark.parametrize("quality", [0.0, 0.4])
def test_blind_sensor_reports_exact_zeros_with_its_quality_at_both_depths(quality: float) -> None:
    device, bus = (readings_over_blind_ground(depth, quality) for depth in Depth)
    blind = [reading for is_blind, reading in device[20:] if is_blind]
    seen = [reading for is_blind, reading in device[20:] if not is_blind]
    assert min(len(blind), len(seen)) > 50
    assert {reading[1:4] for reading in blind} == {(0.0, 0.0, quality)}
    assert {reading.quality for reading in seen} == {0.8}
    assert all(reading.forward_m > 0.04 for reading in seen), "what passed unseen is not made up for"
    assert max(reading.forward_m for reading in seen) < 0.09
    assert [reading[1:4] for _, reading in bus] == [pytest.approx(reading[1:4]) for _, reading in device]


def test_false_height_multiplies_and_is_drawn_once_a_trial() -> None:
    physics = replace(STEADY, flow_scale_sd=0.15, flow_noise_counts=0.0, flow_noise_share=0.0)
    for seed in range(4):
        world = world_of(physics)
        flow = FlowSensorModel(world, RandomStreams(seed))
        scale = flow_scale(physics, RandomStreams(seed))
        for seconds_s in (2.0, 4.0):
            before_m = world.forward_m
            world.command(1.0, 1.0)
            counts, _ = flow.sample(seconds_s)
            assert counts * FLOW_M_PER_COUNT == pytest.approx((world.forward_m - before_m) * scale, abs=0.001)
    scales = [flow_scale(replace(physics, flow_scale_sd=0.5), RandomStreams(seed)) for seed in range(400)]
    assert min(scales) > 0.0
    assert fmean(scales) == pytest.approx(exp(0.125), rel=0.1)
    assert pstdev(scales) > 0.4
