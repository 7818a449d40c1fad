"""Simulated parts report what the real ones would, and leave the world as it is."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from math import pi
from statistics import fmean, pstdev

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.simhal.clearing import STEADY, VEHICLE, steady_world
from tests.virtual import virtual
from wayfarer.angles import offset_m
from wayfarer.config.rover_file import RoverConfig
from wayfarer.fieldlog.record import WORLD_CORNER
from wayfarer.hal import STOP, Side, WheelCommand
from wayfarer.simhal.parts import FIX_ERROR_M, SimBumper, SimCompass, SimFlow, SimMotors, SimReceiver
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import FLOW_M_PER_COUNT, TO_WHOLE, HeadingSensorModel
from wayfarer.simhal.world.forest import CLEARING, Trunk
from wayfarer.simhal.world.world import World

BARE = RoverConfig(name="bare", vehicle=VEHICLE)  # without parts: all that is simulated
FENCED = replace(CLEARING, trunks=(Trunk(20.0, 13.0, 30.0, 15.0, "across"),), trees_m=((25.0, 11.0),))


async def drive(motors: SimMotors, left: float, right: float, seconds_s: float) -> None:
    """Command the wheels as often as the controller does: after 0.3 s of silence they stop by themselves."""
    for period_s in [0.05] * int(seconds_s / 0.05 + 1e-9):
        await motors.drive(WheelCommand(left, right))
        await asyncio.sleep(period_s)


@settings(deadline=None)
@given(heading_deg=st.one_of(st.floats(359.9, 360, exclude_max=True), st.floats(0, 359.999)))
@virtual
async def test_bearing_is_quantised_and_never_360(heading_deg: float) -> None:
    world = steady_world()
    world.heading_rad = heading_deg * pi / 180 + 4 * pi
    compass = SimCompass(world, RandomStreams(0))
    await compass.open()
    for _ in range(50):
        reading = await compass.read()
        assert 0.0 <= reading.heading_deg < 360.0
        assert all(value == round(value, 1) for value in (reading.heading_deg, reading.pitch_deg, reading.roll_deg))
        error_deg = (reading.heading_deg - heading_deg + 180.0) % 360.0 - 180.0
        assert abs(error_deg) < 6 * STEADY.compass_noise_deg


@pytest.mark.parametrize("bias_deg", [-40.0, 12.5])
def test_biased_compass_reads_that_much_more_each_time(bias_deg: float) -> None:
    biased = World(CLEARING, VEHICLE, replace(STEADY, compass_bias_deg=bias_deg), RandomStreams(0))
    tenths = [HeadingSensorModel(world, RandomStreams(0)).sample(0.0) for world in (steady_world(), biased)]
    assert (tenths[1][0] - tenths[0][0]) % 3600 == pytest.approx(bias_deg * 10 % 3600, abs=1)
    assert tenths[1][1:] == tenths[0][1:]


@virtual
async def test_compass_noise_is_that_of_the_reference() -> None:
    world = steady_world()
    world.heading_rad, world.pitch_deg = pi, 20.0
    compass = SimCompass(world, RandomStreams(0))
    await compass.open()
    readings = [await compass.read() for _ in range(2000)]
    headings_deg = [reading.heading_deg for reading in readings]
    assert fmean(headings_deg) == pytest.approx(180.0, abs=0.1)
    assert pstdev(headings_deg) == pytest.approx(1.0, rel=0.05)
    assert fmean(reading.pitch_deg for reading in readings) == pytest.approx(20.0, abs=0.1)
    assert fmean(reading.roll_deg for reading in readings) == pytest.approx(0.0, abs=0.1)


@virtual
async def test_displacements_are_whole_counts_that_add_up_to_the_odometer() -> None:
    world = steady_world()
    flow, motors = SimFlow(world, RandomStreams(0)), SimMotors(world)
    for part in (flow, motors):
        await part.open()
    assert (await flow.read()).quality == 0.0, "since nobody knows when"
    read_m = 0.0
    for duty, seconds_s in ((1.0, 0.1), (0.3, 0.25), (-0.5, 0.1), (0.0, 0.05)) * 50:
        await drive(motors, duty, duty, seconds_s)
        reading = await flow.read()
        counts = reading.forward_m / FLOW_M_PER_COUNT
        assert counts == pytest.approx(round(counts), abs=1e-6)
        assert 0.0 < reading.quality <= 1.0
        read_m += reading.forward_m
    true_m = world.forward_m - world.reverse_m
    assert true_m > 5.0
    assert read_m == pytest.approx(true_m, rel=0.02)
    assert (await flow.read()).forward_m == pytest.approx(0.0, abs=10 * FLOW_M_PER_COUNT)


@given(value=st.floats(-(2.0**50), 2.0**50) | st.integers(-(2**40), 2**40).map(lambda halves: halves / 2.0))
def test_chip_units_are_rounded_as_python_rounds(value: float) -> None:
    assert value + TO_WHOLE - TO_WHOLE == round(value)


@virtual
async def test_bumper_feels_the_side_and_the_axis_of_a_trunk_and_only_the_side_of_a_tree() -> None:
    world = steady_world(FENCED)
    bumper, motors = SimBumper(world), SimMotors(world)
    for part in (bumper, motors):
        await part.open()
    assert (await bumper.read())[1:] == ((), None)
    await drive(motors, 0.5, 0.5, 3.0)
    at_trunk = await bumper.read()
    assert at_trunk.sides == (Side.LEFT,)
    assert at_trunk.obstacle_bearing_deg == pytest.approx(78.69, abs=0.01)
    await drive(motors, -0.5, -0.5, 5.0)
    at_tree = await bumper.read()
    assert at_tree[1:] == ((Side.REAR,), None)


@virtual
async def test_wheels_stop_by_themselves_when_nobody_commands_them_any_more() -> None:
    world = steady_world()
    motors = SimMotors(world)
    await motors.open()
    await drive(motors, 1.0, 1.0, 1.0)
    last_s = asyncio.get_running_loop().time() - 0.05
    while world.commanded != (0.0, 0.0):
        await asyncio.sleep(0.05)
        world.advance_to(asyncio.get_running_loop().time())
    assert asyncio.get_running_loop().time() - last_s == pytest.approx(0.3, abs=0.051)


@virtual
async def test_motors_apply_what_they_say_and_stop() -> None:
    world = steady_world()
    motors = SimMotors(world)
    await motors.open()
    assert await motors.drive(WheelCommand(1.0, 0.5)) == WheelCommand(1.0, 63 / 127)
    await drive(motors, 1.0, 0.5, 2.0)
    assert await motors.drive(STOP) == STOP
    driven_m = world.path_m
    assert driven_m == pytest.approx(2.0 * 1.4 * 0.75, rel=0.1)
    await motors.drive(WheelCommand(1.0, 1.0))
    await motors.stop()
    await asyncio.sleep(5.0)
    assert await motors.drive(STOP) == STOP
    assert world.path_m == pytest.approx(driven_m, abs=0.2)
    health = await motors.health()
    assert health.battery_v is not None
    assert health.faults == ()


@virtual
async def test_receiver_tells_where_the_rover_is_as_well_as_receivers_do() -> None:
    world = steady_world()
    receiver = SimReceiver(world, RandomStreams(0))
    await receiver.open()
    fixes = [await receiver.read() for _ in range(400)]
    north_m, east_m = zip(*(offset_m(WORLD_CORNER, fix) for fix in fixes), strict=True)
    assert fmean(north_m) == pytest.approx(world.y_m, abs=4 * FIX_ERROR_M / 20)
    assert fmean(east_m) == pytest.approx(world.x_m, abs=4 * FIX_ERROR_M / 20)
    assert pstdev(north_m) == pytest.approx(FIX_ERROR_M, rel=0.2)
