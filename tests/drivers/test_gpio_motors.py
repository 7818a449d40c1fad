"""Motors on GPIO pins: the right pins in the right state, and stops that always work."""

from __future__ import annotations

import gc
import threading
from importlib import import_module
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.virtual import virtual
from wayfarer.drivers.gpio_motors import GpioMotors, GpioMotorsSettings
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, WheelCommand

pytestmark = pytest.mark.usefixtures("board")
PIN_CLASS = "MockPWMPin"
PINS = (17, 18, 22, 23)

duties = st.floats(-1, 1)


async def opened(**settings: Any) -> GpioMotors:
    motors = GpioMotors(GpioMotorsSettings(*PINS, **settings), LinuxBuses())
    await motors.open()
    return motors


def states(board: Any, *pins: int) -> list[float]:
    return [round(board.pin(pin).state, 9) for pin in pins or PINS]


def test_devices_that_nobody_closed_are_no_deadlock_for_the_next_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """gpiozero closes them when they are collected, and waits for the lock that claiming pins holds meanwhile."""
    board_info = import_module("gpiozero.pins").BoardInfo
    find_pin = board_info.find_pin

    def collects_first(*asked: Any) -> Any:
        if gc.isenabled():
            gc.collect()
        return find_pin(*asked)

    @virtual
    async def claim() -> None:
        motors = GpioMotors(GpioMotorsSettings(5, 6, 12, 13), LinuxBuses())
        await motors.open()
        motors.itself = motors  # type: ignore[attr-defined]  # a cycle: left to the garbage collector
        del motors
        monkeypatch.setattr(board_info, "find_pin", collects_first)
        kept = await opened()
        await kept.close()

    worker = threading.Thread(target=claim, daemon=True)
    worker.start()
    worker.join(10.0)
    assert not worker.is_alive()


@virtual
async def test_each_direction_drives_its_own_pin_and_only_that(board: Any) -> None:
    motors = await opened()
    assert states(board) == [0, 0, 0, 0]
    await motors.drive(WheelCommand(0.5, -0.25))
    assert states(board) == [0.5, 0, 0, 0.25]
    await motors.drive(WheelCommand(-1.0, 1.0))
    assert states(board) == [0, 1, 1, 0]


@virtual
async def test_enable_pins_are_high_while_the_motors_are_open(board: Any) -> None:
    motors = await opened(left_enable=24, right_enable=25)
    assert states(board, 24, 25) == [1, 1]
    await motors.close()
    assert [board.pin(pin).function for pin in (24, 25)] == ["input", "input"]


@given(command=st.builds(WheelCommand, duties, duties), duty_limit=st.floats(0.01, 1))
@virtual
async def test_what_was_applied_is_what_is_read_back_and_within_the_limit(
    command: WheelCommand, duty_limit: float
) -> None:
    motors = await opened(duty_limit=duty_limit)
    applied = await motors.drive(command)
    assert await motors.read_back() == pytest.approx(applied)
    assert max(map(abs, applied)) <= duty_limit * (1 + 1e-12)
    assert applied.left * command.right == pytest.approx(applied.right * command.left)  # the same curve
    if max(map(abs, command)) <= duty_limit:
        assert applied == command
    await motors.close()


@pytest.mark.parametrize("is_open", [False, True])
@virtual
async def test_stop_holds_every_pin_low_also_before_open(board: Any, is_open: bool) -> None:
    motors = await opened()
    await motors.drive(WheelCommand(1.0, -1.0))
    if not is_open:
        await motors.close()
    await motors.stop()
    assert states(board) == [0, 0, 0, 0]
    assert {board.pin(pin).function for pin in PINS} == {"output"}
    assert await motors.read_back() == STOP


@virtual
async def test_halt_works_from_another_thread(board: Any) -> None:
    motors = await opened()
    await motors.drive(WheelCommand(0.6, 0.6))
    thread = threading.Thread(target=motors.halt)
    thread.start()
    thread.join()
    assert states(board) == [0, 0, 0, 0]


@virtual
async def test_opening_again_stops_but_does_not_let_the_pins_float(board: Any) -> None:
    motors = await opened()
    await motors.drive(WheelCommand(0.6, 0.6))
    functions: list[str] = []
    board.pin(17)._set_function = functions.append
    await motors.open()
    assert states(board) == [0, 0, 0, 0]
    assert functions == []


def fail(*_: object) -> None:
    raise RuntimeError("lost touch")


@virtual
async def test_one_side_that_fails_does_not_keep_the_other_from_stopping(
    board: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    motors = await opened()
    await motors.drive(WheelCommand(0.6, 0.6))
    monkeypatch.setattr(motors._devices["left"], "stop", fail)
    motors.halt()
    assert states(board, 22, 23) == [0, 0]


@pytest.mark.parametrize("broken", [17, 22])
@virtual
async def test_a_pin_that_fails_stops_both_sides(board: Any, monkeypatch: pytest.MonkeyPatch, broken: int) -> None:
    motors = await opened()
    await motors.drive(WheelCommand(0.4, 0.4))
    set_state = board.pin(broken)._set_state
    monkeypatch.setattr(board.pin(broken), "_set_state", lambda state: fail() if state else set_state(state))
    with pytest.raises(NotResponding, match="the pins failed: lost touch"):
        await motors.drive(WheelCommand(0.6, 0.6))
    assert states(board) == [0, 0, 0, 0]


@virtual
async def test_duties_beyond_full_are_full_and_what_is_no_number_reaches_no_pin(board: Any) -> None:
    motors = await opened(duty_limit=0.5)
    assert await motors.drive(WheelCommand(inf, 0.1)) == (0.5, 0.05)
    assert await motors.drive(WheelCommand(-7.0, 1.5)) == (-0.5, 0.5)
    assert states(board) == [0, 0.5, 0.5, 0]
    for broken in (WheelCommand(0.1, nan), WheelCommand(nan, 0.1)):
        with pytest.raises(ValueError, match="NaN"):
            await motors.drive(broken)
    assert states(board) == [0, 0.5, 0.5, 0]


@virtual
async def test_there_is_no_deadman_and_nothing_is_known_of_the_battery() -> None:
    motors = await opened()
    assert motors.deadman_s is None
    assert await motors.health() == (None, ())
