"""The Sabertooth driver tells a board that never answers all that it must not forget."""

from __future__ import annotations

import asyncio
from typing import Any, Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from tests.kit.boards import SabertoothBench
from tests.virtual import virtual
from wayfarer.drivers import sabertooth
from wayfarer.drivers.sabertooth import SabertoothSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, DriveMotors, MotorHealth, WheelCommand

TIMEOUT, STAND = "80 0E 03 11", "80 00 00 00 80 04 00 04"

# -- what goes over the wire -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "command", "sent"),
    [
        ({}, WheelCommand(1.0, -0.5), f"80 00 7F 7F 80 05 3F 44 {TIMEOUT}"),
        ({}, STOP, STAND),
        (
            {"address": 130, "left": 2, "reverse_left": True},
            WheelCommand(1.0, 0.5),
            "82 05 7F 06 82 00 3F 41 82 0E 03 13",
        ),
    ],
)
@virtual
async def test_both_sides_go_out_in_one_write_and_the_timeout_behind_a_command_to_move(
    settings: dict[str, Any], command: WheelCommand, sent: str
) -> None:
    bench = await SabertoothBench(**settings).opened()
    await bench.motors.drive(command)
    assert bench.sent() == [sent]


@pytest.mark.parametrize(
    ("settings", "sent", "taken"),
    [
        ({}, TIMEOUT, {14: 3}),
        ({"timeout_s": 0.1}, "80 0E 01 0F", {14: 1}),
        ({"timeout_s": 12.7}, "80 0E 7F 0D", {14: 127}),
        ({"battery_min_v": 6.0}, f"{TIMEOUT} 80 02 00 02", {14: 3, 2: 0}),
        ({"battery_min_v": 10.15}, f"{TIMEOUT} 80 02 15 17", {14: 3, 2: 21}),
        ({"battery_min_v": 30.0}, f"{TIMEOUT} 80 02 78 7A", {14: 3, 2: 120}),
    ],
)
@virtual
async def test_opening_sets_the_timeout_in_tenths_and_the_lowest_voltage_in_fifths_and_stands_still(
    settings: dict[str, Any], sent: str, taken: dict[int, int]
) -> None:
    bench = SabertoothBench(**settings)
    await bench.motors.open()
    assert bench.sent() == [f"{STAND} {sent}"]
    assert bench.chip.settings == taken


@given(lost=st.sets(st.integers(0, 23), max_size=2))
@settings(deadline=None)
@virtual
async def test_stop_gets_through_where_two_bytes_are_lost(lost: set[int]) -> None:
    bench = SabertoothBench()
    await bench.motors.drive(WheelCommand(0.5, -0.5))
    bench.lost = lost
    await bench.motors.stop()
    assert bench.world.commanded == STOP


# -- a board that takes the line's speed from the first byte ---------------------------------------------------------


@virtual
async def test_old_board_gets_its_autobaud_byte_first_after_its_start_up_time_and_before_each_command() -> None:
    bench = SabertoothBench(autobaud=True)
    began_s = asyncio.get_running_loop().time()
    await bench.motors.open()
    assert asyncio.get_running_loop().time() - began_s == 2.0
    assert bench.sent() == [f"AA {STAND} {TIMEOUT}"]
    await bench.motors.drive(WheelCommand(1.0, -0.5))
    assert bench.sent()[-1] == f"AA 80 00 7F 7F 80 05 3F 44 {TIMEOUT}"
    assert bench.world.commanded == (1.0, -63 / 127)
    opened_s = asyncio.get_running_loop().time()
    await bench.motors.open()
    assert asyncio.get_running_loop().time() == opened_s, "only the first opening waits"
    await bench.motors.stop()
    bench.motors.halt()
    assert bench.sent()[-2:] == [f"AA {' '.join([STAND] * 3)}"] * 2
    assert bench.world.commanded == STOP


@virtual
async def test_old_board_that_lost_its_power_takes_commands_again_after_its_start_up_time() -> None:
    bench = await SabertoothBench(autobaud=True).opened()
    bench.chip.power_cycle()
    for tick in range(1, 50):
        await asyncio.sleep(0.05)
        await bench.motors.drive(WheelCommand(0.5, 0.5))
        assert tick == 40 or (bench.world.commanded == STOP) is (tick < 40), tick
    assert bench.chip.settings == {14: 3}


@virtual
async def test_old_board_is_deaf_to_a_driver_that_does_not_know_it() -> None:
    bench = await SabertoothBench(old_board=True).opened()
    await asyncio.sleep(3.0)
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert (bench.world.commanded, bench.chip.settings) == ((0.0, 0.0), {})


@virtual
async def test_board_that_stores_its_speed_passes_the_byte_over() -> None:
    bench = await SabertoothBench(old_board=False, autobaud=True).opened()
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert (bench.chip.dropped, bench.chip.settings) == (0, {14: 3})
    assert bench.world.commanded == (63 / 127, 63 / 127)


# -- the deadman -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "before", "after"),
    [
        ({"battery_min_v": 10.0}, {14: 3}, {14: 3, 2: 20}),
        ({"baud": 2400}, {}, {14: 3}),  # the wire cannot carry the timeout behind each command
    ],
)
@virtual
async def test_an_invisible_reset_takes_settings_for_a_second_and_the_timeout_for_one_command(
    settings: dict[str, Any], before: dict[int, int], after: dict[int, int]
) -> None:
    bench = await SabertoothBench(**settings).opened()
    bench.chip.power_cycle()
    for _ in range(19):
        await asyncio.sleep(0.05)
        await bench.motors.drive(WheelCommand(0.5, 0.5))
        assert bench.chip.settings == before
    await asyncio.sleep(0.1)
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.chip.settings == after


@pytest.mark.parametrize("heard_from", range(13))
@virtual
async def test_a_board_that_starts_amid_a_command_turns_no_wheel_without_its_timeout(heard_from: int) -> None:
    bench = SabertoothBench()
    await bench.motors.open()
    bench.chip.power_cycle()
    bench.lost = set(range(heard_from))
    await bench.motors.drive(WheelCommand(0.5, 0.5))
    assert bench.world.commanded == STOP or bench.chip.settings == {14: 3}


# -- what it cannot know ---------------------------------------------------------------------------------------------


@virtual
async def test_nothing_is_claimed_of_a_board_that_cannot_be_asked() -> None:
    motors: DriveMotors = SabertoothBench().motors
    assert await motors.read_back() is None
    assert await motors.health() == MotorHealth(None, ())


@virtual
async def test_a_port_that_is_gone_is_told_by_all_but_stop_and_its_board_gets_its_settings_when_it_is_back() -> None:
    bench = SabertoothBench()
    bench.line.gone = True
    for call in (bench.motors.open, lambda: bench.motors.drive(STOP)):
        with pytest.raises(NotResponding, match="/dev/serial0: the port is gone"):
            await call()
    await bench.motors.stop()
    bench.line.gone = False
    await bench.motors.drive(STOP)
    assert bench.chip.settings == {14: 3}


@given(tenths=st.integers(1, 127))
def test_every_tenth_of_a_second_can_be_set(tenths: int) -> None:
    settings = TypeAdapter(SabertoothSettings).validate_python({"timeout_s": tenths / 10, "battery_min_v": None})
    assert settings.timeout_s == tenths / 10


# -- the load of the wire --------------------------------------------------------------------------------------------


async def share_of_wire(control_hz: float, baud: int, *, autobaud: bool) -> float:
    """Drive for ten seconds and return which share of the wire's time the bytes take, with start and stop bit."""
    bench = await SabertoothBench(baud=baud, battery_min_v=10.0, autobaud=autobaud).opened()
    for _ in range(round(10.0 * control_hz)):
        await asyncio.sleep(1.0 / control_hz)
        await bench.motors.drive(WheelCommand(0.5, 0.5))
    return sum(map(len, bench.seen)) * 10 / baud / 10.0


@pytest.mark.parametrize(
    ("baud", "resend_s", "autobaud"),
    [(2400, 1.0, False), (9600, 1.0, False), (2400, 0.5, False), (2400, 1.0, True), (9600, 1.0, True)],
)
@virtual
async def test_control_rate_is_refused_from_where_it_takes_more_than_7_tenths_of_the_wire(
    baud: Literal[2400, 9600], resend_s: float, autobaud: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rest is for stops; the lowest voltage goes out with the other settings."""
    monkeypatch.setattr(sabertooth, "_RESEND_S", resend_s)
    given = SabertoothSettings(baud=baud, battery_min_v=10.0, autobaud=autobaud)
    fastest_hz = max(hz for hz in range(1, 200) if given.keeps_up_with(hz) is None)
    assert await share_of_wire(fastest_hz, baud, autobaud=autobaud) <= 0.7
    assert await share_of_wire(fastest_hz + 1, baud, autobaud=autobaud) > 0.7
    assert f"baud = {baud}" in str(given.keeps_up_with(fastest_hz + 1))
