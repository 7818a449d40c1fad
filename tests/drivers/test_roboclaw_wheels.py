"""The wheels of a RoboClaw: counters that wrap and restart, currents without their sign, and no longer deadman."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.boards import RoboClawBench, now_s
from tests.virtual import virtual
from wayfarer.drivers.roboclaw_board import Opcode
from wayfarer.drivers.roboclaw_wheels import RoboClawWheels, RoboClawWheelsSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, WheelCommand, WheelReading, WheelSensor
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.roboclaw import Encoders
from wayfarer.testing import check_wheel_sensor

COUNTS_PER_M = 4000.0


class Bench(RoboClawBench):
    """A RoboClaw and both its drivers; the encoders are wired as the wheels' settings say."""

    def __init__(self, **wheels: Any) -> None:
        super().__init__()
        settings = RoboClawWheelsSettings(**{"counts_per_m": COUNTS_PER_M} | wheels)
        signs = (-1 if settings.reverse_left else 1), (-1 if settings.reverse_right else 1)
        if settings.counts_per_m:
            self.chip.encoders = Encoders(1.0 / settings.counts_per_m, settings.left == 2, *signs)
        self.wheels = RoboClawWheels(settings, self.buses)

    async def rolled(self, left: float, right: float, for_s: float = 1.0) -> WheelReading:
        """Drive, and return what the wheels did from before to after that."""
        await self.wheels.read()
        for _ in range(round(for_s / 0.05)):
            await self.motors.drive(WheelCommand(left, right))
            await asyncio.sleep(0.05)
        return await self.wheels.read()


@virtual
async def test_it_keeps_what_a_wheel_sensor_promises() -> None:
    assert isinstance(Bench().wheels, WheelSensor)
    await check_wheel_sensor(lambda: Bench().wheels, lambda: RoboClawWheels(RoboClawWheelsSettings(), FakeBuses()))


@pytest.mark.parametrize("wiring", [{}, {"left": 2}, {"reverse_left": True}, {"left": 2, "reverse_right": True}])
@virtual
async def test_ways_and_currents_are_those_of_each_side_however_they_are_wired(wiring: dict[str, Any]) -> None:
    bench = await Bench(**wiring).opened()
    await bench.wheels.open()
    first = await bench.wheels.read()
    assert (first.left_m, first.right_m) == (None, None)
    before = bench.world.rims_m
    reading = await bench.rolled(0.6, -0.3)
    assert (reading.left_m, reading.right_m) == pytest.approx(
        [after - was for after, was in zip(bench.world.rims_m, before, strict=True)], abs=2.0 / COUNTS_PER_M
    )
    assert reading.left_m is not None and reading.left_m > 0.3
    assert reading.right_m is not None and reading.right_m < -0.1
    loads = bench.world.motor_load
    currents = [load * bench.world.stall_current_a for load in loads]
    if wiring.get("left") == 2:  # the motors of this bench are wired the other way round
        currents.reverse()
    assert (reading.left_a, reading.right_a) == pytest.approx(currents, abs=0.01)


@virtual
async def test_without_encoders_only_the_currents_are_read() -> None:
    bench = await Bench(counts_per_m=None).opened()
    reading = await bench.rolled(0.5, 0.5)
    assert (reading.left_m, reading.right_m) == (None, None)
    assert reading.left_a is not None and reading.left_a > 0.0
    assert "80 4E" not in bench.sent()


@given(began=st.integers(0, 2**32 - 1), first=st.integers(-1500, 1500), second=st.integers(-1500, 1500))
@virtual
async def test_counters_wrap(began: int, first: int, second: int) -> None:
    bench = await Bench().opened()
    bench.chip.counters_began = (-began, -began)
    await bench.wheels.read()
    bench.chip.counters_began = (-began - first, -began - second)
    await asyncio.sleep(0.05)
    reading = await bench.wheels.read()
    assert (reading.left_m, reading.right_m) == pytest.approx((first / COUNTS_PER_M, second / COUNTS_PER_M))


@virtual
async def test_way_of_a_read_that_failed_is_in_the_next_one() -> None:
    bench = await Bench().opened()
    await bench.wheels.read()
    before = bench.world.rims_m
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    await asyncio.sleep(0.1)
    with pytest.raises(NotResponding):
        bench.lost = lambda data: data[1] == Opcode.GET_CURRENTS
        await bench.wheels.read()
    bench.lost = lambda _: False
    reading = await bench.wheels.read()
    assert reading.left_m is not None and reading.left_m > 0.01
    assert reading.left_m == pytest.approx(bench.world.rims_m[0] - before[0], abs=2.0 / COUNTS_PER_M)


@virtual
async def test_counters_that_begin_again_say_nothing_once() -> None:
    bench = await Bench().opened()
    await bench.rolled(0.5, 0.5, for_s=3.0)
    bench.chip.power_cycle()
    restarted = await bench.wheels.read()
    assert (restarted.left_m, restarted.right_m) == (None, None)
    assert bench.wheels.error_counts == {"counters restarted": 1}
    assert (await bench.wheels.read()).left_m == 0.0


@virtual
async def test_wheels_that_are_read_on_do_not_keep_the_motors_running() -> None:
    bench = await Bench().opened()
    await bench.rolled(0.5, 0.5)
    began_s = now_s() - 0.05  # the last command
    while bench.world.commanded != STOP:
        await asyncio.sleep(0.05)
        await bench.wheels.read()
    assert bench.motors.deadman_s is not None
    assert now_s() - began_s <= bench.motors.deadman_s
