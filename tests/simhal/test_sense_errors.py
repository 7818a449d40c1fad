"""Errors of compass and flow sensor: each is what it says, and the same at both depths."""

from __future__ import annotations

import asyncio
from dataclasses import asdict, replace
from math import degrees, exp, radians
from statistics import fmean, pstdev

import pytest

from tests.simhal.clearing import STEADY, VEHICLE
from tests.virtual import virtual
from wayfarer.angles import wrap180
from wayfarer.config.rover_file import load_rover
from wayfarer.hal import CompassReading, MotionReading, WheelCommand
from wayfarer.simhal.build_rover import build
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import (
    FLOW_M_PER_COUNT,
    BlindGround,
    FlowSensorModel,
    HeadingSensorModel,
    compass_errs,
    flow_scale,
)
from wayfarer.simhal.world.forest import CLEARING, WORLD_SIZE_M
from wayfarer.simhal.world.physics import FIELD, Depth, Physics, Senses
from wayfarer.simhal.world.world import World

# -- compass -----------------------------------------------------------------------------------------------------------

EXACT = replace(STEADY, compass_noise_deg=0.0, tilt_noise_deg=0.0)


class Bench:
    """A world and the compass in it, without noise; ``error_deg`` is what it reads off, clockwise."""

    def __init__(self, physics: Physics, seed: int = 0) -> None:
        self.world = World(CLEARING, VEHICLE, physics, RandomStreams(seed))
        self.compass = HeadingSensorModel(self.world, RandomStreams(seed))

    def error_deg(self) -> float:
        heading, _, _ = self.compass.sample(self.world.t_s)
        return round(wrap180(heading / 10.0 - degrees(self.world.heading_rad)), 9)

    def errors_round(self) -> list[float]:
        """The error at each whole degree of a turn."""
        errors = []
        for heading_deg in range(360):
            self.world.heading_rad = radians(heading_deg)
            errors.append(self.error_deg())
        return errors


def test_senses_without_errors_are_those_of_the_world() -> None:
    assert not compass_errs(STEADY)
    bench = Bench(EXACT)
    assert set(bench.errors_round()) == {0.0}


@pytest.mark.parametrize(("key", "cycles"), [("hard_iron_deg", 1), ("soft_iron_deg", 2)])
def test_iron_bends_the_heading_in_cycles_with_another_phase_in_each_trial(key: str, cycles: int) -> None:
    physics = replace(EXACT, **{key: 8.0})
    errors = Bench(physics).errors_round()
    assert (max(errors), min(errors)) == pytest.approx((8.0, -8.0), abs=0.06)
    assert sum((a < 0.0) != (b < 0.0) for a, b in zip(errors, errors[1:] + errors[:1], strict=True)) == 2 * cycles
    assert fmean(errors) == pytest.approx(0.0, abs=0.01)
    assert Bench(physics).errors_round() == errors
    assert Bench(physics, seed=1).errors_round() != errors


def test_field_of_the_motors_flips_with_their_direction_and_a_turn_is_not_a_straight_drive() -> None:
    bench = Bench(replace(EXACT, motor_field_deg=8.0))
    errors = {}
    for duties in ((0.0, 0.0), (1.0, 0.0), (0.5, 0.0), (-1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)):
        bench.world.command(*duties)
        errors[duties] = bench.errors_round()
    assert set(errors[0.0, 0.0]) == {0.0}
    assert max(errors[1.0, 0.0]) == pytest.approx(8.0, abs=0.06)
    assert max(errors[0.5, 0.0]) == pytest.approx(4.0, abs=0.06)
    assert errors[-1.0, 0.0] == pytest.approx([-error for error in errors[1.0, 0.0]], abs=0.11)
    for turn, sign in ((1.0, 1.0), (-1.0, -1.0)):
        both = [left + sign * right for left, right in zip(errors[1.0, 0.0], errors[0.0, 1.0], strict=True)]
        assert errors[1.0, turn] == pytest.approx(both, abs=0.21)
    assert errors[1.0, 1.0] != pytest.approx(errors[1.0, -1.0], abs=1.0)


def test_late_compass_reads_the_attitude_of_that_long_ago() -> None:
    bench = Bench(replace(EXACT, compass_lag_s=0.4))
    attitudes, readings = [], []
    for look in range(60):
        bench.world.command(0.3, -0.3) if look == 10 else None
        bench.world.pitch_deg = float(look)
        bench.world.advance_to(look * 0.05)
        heading_rad, pitch_deg, _ = bench.world.attitude()
        attitudes.append((round(degrees(heading_rad) * 10.0) % 3600, round(pitch_deg * 10.0)))
        readings.append(bench.compass.sample(look * 0.05)[:2])
    assert readings[8:] == attitudes[:-8]
    assert set(readings[:8]) == {attitudes[0]}
    assert attitudes[-1][0] - attitudes[-9][0] > 100, "it turns"


def readings_of_a_turn(physics: Physics, rate_deg_s: float, for_s: float) -> list[float]:
    """The headings that a body reads that turns steadily from 0."""
    bench = Bench(physics)
    headings = []
    for look in range(int(for_s / 0.05)):
        bench.world.advance_to(look * 0.05)
        bench.world.heading_rad = radians(rate_deg_s * look * 0.05)
        headings.append(bench.compass.sample(look * 0.05)[0] / 10.0)
    return headings


def test_frozen_heading_stays_while_the_body_turns_slowly_and_goes_on_from_there() -> None:
    physics = replace(EXACT, compass_freezes_below_deg_s=3.0)
    assert set(readings_of_a_turn(physics, 2.8, 20.0)) == {0.0}
    assert readings_of_a_turn(physics, 3.2, 20.0)[-1] == pytest.approx(3.2 * 19.95, abs=0.1)
    bench = Bench(physics)
    for look in range(1, 101):  # 2 s slowly, 1 s fast, 2 s slowly
        bench.world.advance_to(look * 0.05)
        bench.world.heading_rad += radians(30.0 if 40 < look <= 60 else 2.0) * 0.05
        heading, _, _ = bench.compass.sample(bench.world.t_s)
    assert degrees(bench.world.heading_rad) == pytest.approx(38.0)
    assert heading / 10.0 == pytest.approx(30.0, abs=0.1)


def test_vibration_shakes_pitch_and_roll_with_the_duty_and_not_the_heading() -> None:
    bench = Bench(replace(EXACT, tilt_vibration_deg=2.0))
    for duty in (0.0, 0.5, 1.0):
        bench.world.command(-duty, duty)
        samples = [bench.compass.sample(0.0) for _ in range(2000)]
        assert {heading for heading, _, _ in samples} == {0}
        for axis in (1, 2):
            tilts_deg = [sample[axis] / 10.0 for sample in samples]
            assert pstdev(tilts_deg) == pytest.approx(2.0 * duty, rel=0.1, abs=0.001)


def test_field_has_a_value_for_every_error_that_is_neutral_by_default() -> None:
    neutral = {name for name, value in asdict(Senses()).items() if value == 0.0}
    assert set(FIELD) == neutral - {"compass_bias_deg"} | {"blind_cell_m"}
    assert compass_errs(replace(STEADY, **FIELD))


def test_both_depths_read_the_same_with_all_errors() -> None:
    @virtual
    async def readings(depth: Depth) -> list[CompassReading]:
        config = load_rover("sim")
        world = World(CLEARING, config.vehicle, replace(STEADY, **FIELD), RandomStreams(2))
        rover = build(depth, world, RandomStreams(2), config, asyncio.get_running_loop().time)
        for part in (rover.motors, rover.compass):
            await part.open()
        found = []
        for look in range(100):
            await rover.motors.drive(WheelCommand(0.6, -0.2 if look < 50 else 0.6))
            await asyncio.sleep(0.05)
            found.append((await rover.compass.read())._replace(t_s=0.0))
        return found

    device, bus = readings(Depth.DEVICE), readings(Depth.BUS)
    assert device == bus
    assert len({reading.heading_deg for reading in device}) > 50


# -- flow sensor -------------------------------------------------------------------------------------------------------

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
