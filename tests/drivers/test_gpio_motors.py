"""Motors on GPIO pins: the right pins in the right state, and stops that always work."""

from __future__ import annotations

import asyncio
import gc
import threading
from collections.abc import Callable
from importlib import import_module
from itertools import pairwise
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.clearing import steady_world
from tests.virtual import virtual
from wayfarer.drivers.gpio_motors import GpioMotors, GpioMotorsSettings
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, MotorHealth, WheelCommand
from wayfarer.simhal.built_in_chips import GPIO_MOTORS
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chip_wiring import ChipWiring
from wayfarer.simhal.chips.h_bridges import HBridgesChip
from wayfarer.simhal.random_streams import RandomStreams

pytestmark = pytest.mark.usefixtures("board")
PIN_CLASS = "MockPWMPin"
PINS = (17, 18, 22, 23)

duties = st.floats(-1, 1)


NAMES = ("left_forward", "left_backward", "right_forward", "right_backward")
TWO_PWM: dict[str, Any] = dict(zip(NAMES, PINS, strict=True))
DIRECTION = {"left_pwm": 17, "left_direction": 18, "right_pwm": 22, "right_direction": 23}
THREE = {**TWO_PWM, "left_pwm": 24, "right_pwm": 25}
SCHEMES = {"two PWM": TWO_PWM, "direction": DIRECTION, "three pins": THREE}
DEADMEN: dict[str, dict[str, Any]] = {"none": {}, "monostable": {"pulse": 5, "deadman_s": 0.3}}
each_scheme = pytest.mark.parametrize("pins", SCHEMES.values(), ids=SCHEMES)


async def opened(**settings: Any) -> GpioMotors:
    motors = GpioMotors(GpioMotorsSettings(**({} if "left_pwm" in settings else TWO_PWM) | settings), LinuxBuses())
    await motors.open()
    return motors


def states(board: Any, *pins: int) -> list[float]:
    return [round(board.pin(pin).state, 3) for pin in pins or PINS]


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
        motors = GpioMotors(
            GpioMotorsSettings(left_pwm=5, left_direction=6, right_pwm=12, right_direction=13), LinuxBuses()
        )
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


@each_scheme
@given(command=st.builds(WheelCommand, duties, duties), duty_limit=st.floats(0.01, 1), flags=st.booleans())
@virtual
async def test_what_was_applied_is_the_whole_percent_that_the_board_gives_its_motors(
    pins: dict[str, Any], command: WheelCommand, duty_limit: float, flags: bool
) -> None:
    """The real driver over simulated pins, and a board that was written from the data sheets."""
    buses, world = FakeBuses(), steady_world()
    settings = GpioMotorsSettings(**pins, duty_limit=duty_limit, reverse_left=flags)
    motors = GpioMotors(settings, buses)
    board = on_a_board(settings, buses, world, lambda: 0.0)
    await motors.open()
    applied = await motors.drive(command)
    assert world.commanded == pytest.approx(applied)
    percent = (applied.left * duty_limit * 100, applied.right * duty_limit * 100)
    assert percent == pytest.approx([round(each) for each in percent], abs=1e-6)
    assert (-board.levels[0] if flags else board.levels[0], board.levels[1]) == pytest.approx(percent)
    for duty, wanted in zip(applied, command, strict=True):
        assert abs(duty) <= abs(wanted) < abs(duty) + 0.01 / duty_limit + 1e-9
        assert duty * wanted >= 0.0
    await motors.stop()
    assert world.commanded == STOP


def on_a_board(settings: GpioMotorsSettings, buses: FakeBuses, world: Any, clock: Callable[[], float]) -> HBridgesChip:
    wiring = ChipWiring(world, RandomStreams(0), clock, buses)
    GPIO_MOTORS.attach(settings, wiring)
    (board,) = wiring.boards
    assert isinstance(board, HBridgesChip)
    return board


@given(before=duties, after=duties)
@each_scheme
@virtual
async def test_change_of_direction_passes_through_zero(pins: dict[str, Any], before: float, after: float) -> None:
    buses, settings = FakeBuses(), GpioMotorsSettings(**pins)
    motors, board = GpioMotors(settings, buses), on_a_board(settings, buses, steady_world(), lambda: 0.0)
    await motors.open()
    await motors.drive(WheelCommand(before, 0.0))
    levels = [board.levels[0]]
    for pin in settings.pins("left").values():
        buses.pins().wire(pin).listeners.append(lambda: levels.append(board.levels[0]))
    await motors.drive(WheelCommand(after, 0.0))
    assert all(one * other >= 0 for one, other in pairwise(levels)), levels
    assert levels[-1] == int(after * 100)


@each_scheme
@virtual
async def test_halt_between_any_two_pins_of_a_command_wins(pins: dict[str, Any]) -> None:
    for number in pins.values():
        buses, settings = FakeBuses(), GpioMotorsSettings(**pins)
        motors, board = GpioMotors(settings, buses), on_a_board(settings, buses, steady_world(), lambda: 0.0)
        await motors.open()
        for command in (WheelCommand(0.5, 0.5), WheelCommand(-0.5, -0.5)):
            changes: list[float | None] = []
            wire = buses.pins().wire(number)

            def halt_once(motors=motors, changes=changes, wire=wire) -> None:  # type: ignore[no-untyped-def]
                changes.append(wire.level)
                if len(changes) == 1:
                    motors.halt()

            wire.listeners.append(halt_once)
            applied = await motors.drive(command)
            wire.listeners.remove(halt_once)
            assert not changes or (applied, board.levels) == (STOP, (0, 0))


@each_scheme
@virtual
async def test_no_side_has_power_while_the_pins_are_released(pins: dict[str, Any]) -> None:
    buses, settings, levels = FakeBuses(), GpioMotorsSettings(**pins), []
    motors, board = GpioMotors(settings, buses), on_a_board(settings, buses, steady_world(), lambda: 0.0)
    await motors.open()
    await motors.drive(WheelCommand(0.5, -0.5))
    for wire in map(buses.pins().wire, pins.values()):
        wire.listeners.append(lambda wire=wire: levels.append(board.levels) if wire.level is None else None)  # type: ignore[misc]
    await motors.close()
    assert set(levels) == {(0, 0)}


@each_scheme
@virtual
async def test_wheels_that_nobody_commands_turn_on_unless_a_monostable_is_there(pins: dict[str, Any]) -> None:
    """The process has died or hangs, and the kernel keeps the level of its pins."""
    time, turned = asyncio.get_running_loop().time, {}
    for name, deadman in DEADMEN.items():
        buses, world = FakeBuses(), steady_world()
        settings = GpioMotorsSettings(**pins, **deadman)
        motors, board = GpioMotors(settings, buses), on_a_board(settings, buses, world, time)
        await motors.open()
        assert motors.deadman_s == settings.deadman_s
        for _ in range(40):
            await motors.drive(WheelCommand(0.5, 0.5))
            board.tick()
            await asyncio.sleep(0.05)
        assert world.commanded == (0.5, 0.5), "pulses in time"
        silent_s = time() - 0.05
        while world.commanded != STOP and time() < silent_s + 3.0:
            await asyncio.sleep(0.01)
            board.tick()
        turned[name] = time() - silent_s
        await motors.drive(WheelCommand(0.0, 0.0))
        await motors.drive(WheelCommand(0.2, 0.2))
        assert world.commanded == (0.2, 0.2), "commands make it drive again"
        await motors.close()
        assert world.commanded == STOP, "pulled down"
    assert turned["none"] >= 3.0
    assert 0.2 < turned["monostable"] <= 0.3


@virtual
async def test_nothing_but_drive_gives_pulses(board: Any) -> None:
    motors = await opened(pulse=5, deadman_s=0.3)
    edges: list[float] = []
    board.pin(5)._set_state = edges.append
    for idle in (motors.open, motors.stop, motors.health, motors.read_back):
        await idle()
    motors.halt()
    assert edges == []
    await motors.drive(STOP)
    assert edges == [1]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"left_forward": 17, "left_backward": 18}, "the right one none"),
        (TWO_PWM | {"left_pwm": 24}, "forward and backward and pwm, the right one forward and backward"),
        ({"left_pwm": 17, "right_pwm": 18}, "each side needs the same pins"),
        (TWO_PWM | {"pulse": 5}, "pulse and deadman_s go together"),
        (TWO_PWM | {"deadman_s": 0.3}, "pulse and deadman_s go together"),
    ],
)
def test_pins_that_are_no_board_are_refused(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        GpioMotorsSettings(**settings)


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
    assert await motors.drive(WheelCommand(inf, 0.1)) == (1.0, 0.1)
    assert await motors.drive(WheelCommand(-7.0, 1.5)) == (-1.0, 1.0)
    assert states(board) == [0, 0.5, 0.5, 0]
    for broken in (WheelCommand(0.1, nan), WheelCommand(nan, 0.1)):
        with pytest.raises(ValueError, match="NaN"):
            await motors.drive(broken)
    assert states(board) == [0, 0.5, 0.5, 0]


@pytest.mark.parametrize(
    ("settings", "high"),
    [
        (TWO_PWM, ""),
        ({**TWO_PWM, "left_forward": 8, "right_enable": 0}, "GPIO 0 and 8 up"),
        ({**DIRECTION, "left_pwm": 9, "left_direction": 5}, ""),  # a direction alone turns no wheel
        ({**DIRECTION, "left_pwm": 7}, "GPIO 7 up"),
    ],
)
def test_inputs_that_are_pulled_up_at_boot_are_told_to_whoever_checks(settings: dict[str, Any], high: str) -> None:
    note = GpioMotors(GpioMotorsSettings(**settings), FakeBuses()).note
    assert (high in note) if high else note == ""


@virtual
async def test_there_is_no_deadman_and_nothing_is_known_of_the_battery() -> None:
    motors = await opened()
    assert motors.deadman_s is None
    assert await motors.health() == MotorHealth(None, ())
    await motors.read_back()
