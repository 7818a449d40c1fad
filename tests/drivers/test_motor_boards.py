"""What is true of every motor board that cuts duties to its own steps and has a deadman of its own."""

from __future__ import annotations

import asyncio
from math import nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from tests.kit.boards import MotorBench, RoboClawBench, SabertoothBench, ThunderBorgBench, now_s
from tests.virtual import virtual
from wayfarer.hal import STOP, DriveMotors, WheelCommand
from wayfarer.simhal.parts import SimMotors
from wayfarer.testing import check_motors

AHEAD = WheelCommand(0.5, 0.5)
DUTIES = st.floats(-1.0, 1.0)

each_board = pytest.mark.parametrize("make", [ThunderBorgBench, SabertoothBench, RoboClawBench])


@each_board
@virtual
async def test_it_keeps_what_motors_promise(make: Any) -> None:
    assert isinstance(make().motors, DriveMotors)
    await check_motors(lambda: make().motors, make.unreachable)


@pytest.mark.parametrize(
    ("make", "lefts"), [(ThunderBorgBench, ("A", "B")), (SabertoothBench, (1, 2)), (RoboClawBench, (1, 2))]
)
@given(
    command=st.builds(WheelCommand, DUTIES, DUTIES),
    duty_limit=st.floats(0.1, 1.0),
    other_left=st.booleans(),
    reverse_left=st.booleans(),
    reverse_right=st.booleans(),
)
@virtual
async def test_what_is_applied_is_what_the_wheels_get_and_at_most_what_was_asked(
    make: Any, lefts: tuple[object, object], command: WheelCommand, other_left: bool, **settings: Any
) -> None:
    """And what the simulated motors of as many steps apply."""
    bench: MotorBench = await make(left=lefts[other_left], **settings).opened()
    applied = await bench.motors.drive(command)
    assert bench.world.commanded == applied
    assert await bench.motors.read_back() in (applied, None)
    for asked, got in zip(command, applied, strict=True):
        assert abs(asked) - 1.0 / bench.steps < abs(got) <= abs(asked)
        assert got * asked >= 0.0
    simulated = SimMotors(bench.world, bench.steps)
    await simulated.open()
    assert await simulated.drive(command) == applied


@each_board
@virtual
async def test_duties_beyond_full_are_full_and_what_is_no_number_reaches_no_motor(make: Any) -> None:
    bench: MotorBench = await make(duty_limit=1.0).opened()
    assert await bench.motors.drive(WheelCommand(1.5, -7.0)) == (1.0, -1.0)
    bench.sent()
    for broken in (WheelCommand(nan, 0.5), WheelCommand(0.5, nan)):
        with pytest.raises(ValueError, match="NaN"):
            await bench.motors.drive(broken)
    assert bench.sent() == []


@pytest.mark.parametrize(
    ("make", "packet", "times"),
    [
        (ThunderBorgBench, "0E 00", (1, 1)),
        (SabertoothBench, "80 00 00 00 80 04 00 04", (3, 3)),
        (RoboClawBench, "80 22 00 00 00 00 98 17", (1, 3)),  # it acknowledges the first
    ],
)
@virtual
async def test_stop_and_halt_switch_both_motors_off(make: Any, packet: str, times: tuple[int, int]) -> None:
    bench: MotorBench = await make().opened()
    for stop, often in zip((bench.motors.stop, bench.motors.halt), times, strict=True):
        await bench.motors.drive(AHEAD)
        assert bench.world.commanded != STOP
        bench.sent()
        if (waiting := stop()) is not None:
            await waiting
        assert bench.sent() == [" ".join([packet] * often)]
        assert bench.world.commanded == STOP


@each_board
@virtual
async def test_halt_that_comes_amid_a_drive_command_wins(make: Any) -> None:
    bench: MotorBench = await make().opened()
    takes = "write" if make is ThunderBorgBench else "receive"
    take = getattr(bench, takes)

    def halted_first(data: bytes) -> Any:
        if data not in (b"\x14", b"\x80\x0f"):  # what asks for a failsafe or a timeout before
            setattr(bench, takes, take)
            bench.motors.halt()
        return take(data)  # the drive command, which was under way

    setattr(bench, takes, halted_first)
    assert await bench.motors.drive(AHEAD) == STOP
    assert bench.world.commanded == STOP


@pytest.mark.parametrize(
    ("make", "settings", "deadman_s"),
    [(ThunderBorgBench, {}, 0.25), (SabertoothBench, {}, 0.3), (SabertoothBench, {"timeout_s": 0.7}, 0.7)],
)
@virtual
async def test_the_deadman_that_is_told_is_the_time_after_which_the_board_stops_the_wheels(
    make: Any, settings: dict[str, float], deadman_s: float
) -> None:
    bench = await make(**settings).opened()
    await bench.motors.drive(AHEAD)
    driven_s = now_s()
    while bench.world.commanded != STOP:
        await asyncio.sleep(0.005)
        bench.chip.tick()
    assert now_s() - driven_s == pytest.approx(deadman_s, abs=0.01)
    assert bench.motors.deadman_s == make.Settings(**settings).deadman_s == deadman_s
    assert await bench.motors.read_back() in (STOP, None)


@pytest.mark.parametrize(
    ("make", "wrong"),
    [
        *((ThunderBorgBench, wrong) for wrong in (
            {"address": 0x78}, {"address": 2}, {"duty_limit": 0.0}, {"left": "C"},
        )),
        *((SabertoothBench, wrong) for wrong in (
            {"address": 127}, {"address": 136}, {"baud": 115200}, {"left": 3}, {"timeout_s": 0.35}, {"timeout_s": 0.0},
            {"timeout_s": 12.8}, {"battery_min_v": 5.9}, {"duty_limit": 1.1}
        )),
        *((RoboClawBench, wrong) for wrong in (
            {"address": 127}, {"address": 136}, {"baud": 9600}, {"left": 3}, {"timeout_s": 0.1}, {"timeout_s": 0.25},
        )),
    ],
)  # fmt: skip
def test_settings_that_no_board_has_are_refused(make: Any, wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(make.Settings).validate_python(wrong)
