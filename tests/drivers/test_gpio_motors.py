"""Motors on GPIO pins: the right pins in the right state, and stops that always work."""

from __future__ import annotations

import asyncio
import sys
import threading
import warnings
from collections.abc import Coroutine
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.drivers.gpio_motors import GpioMotors, GpioMotorsSettings
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, DriveMotors, WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.testing import check_motors

gpiozero = pytest.importorskip("gpiozero")

pytestmark = pytest.mark.usefixtures("board")
PIN_CLASS = "MockPWMPin"

PINS = GpioMotorsSettings(left_forward=17, left_backward=18, right_forward=22, right_backward=23)
WITH_ENABLE = GpioMotorsSettings(17, 18, 22, 23, left_enable=24, right_enable=25)

duties = st.floats(-1, 1)
commands = st.builds(WheelCommand, duties, duties)


def motors_on(settings: GpioMotorsSettings = PINS) -> GpioMotors:
    return GpioMotors(settings, FakeBuses())


def states(board: Any, *pins: int) -> list[float]:
    return [round(board.pin(pin).state, 9) for pin in pins]


def run(main: Coroutine[Any, Any, None]) -> None:
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(main)


def test_keeps_the_promises_of_motors(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(motors_on(), DriveMotors)

    def lost() -> GpioMotors:
        motors = motors_on()
        monkeypatch.setattr(motors, "_make", lambda gpiozero: gpiozero.Motor(99, 100))
        return motors

    run(check_motors(motors_on, lost))


def test_each_direction_drives_its_own_pin_and_only_that(board: Any) -> None:
    async def main() -> None:
        motors = motors_on()
        await motors.open()
        assert states(board, 17, 18, 22, 23) == [0, 0, 0, 0]
        await motors.drive(WheelCommand(0.5, -0.25))
        assert states(board, 17, 18, 22, 23) == [0.5, 0, 0, 0.25]
        await motors.drive(WheelCommand(-1.0, 1.0))
        assert states(board, 17, 18, 22, 23) == [0, 1, 1, 0]
        await motors.close()

    run(main())


def test_enable_pins_are_high_while_the_motors_are_open(board: Any) -> None:
    async def main() -> None:
        motors = motors_on(WITH_ENABLE)
        await motors.open()
        assert states(board, 24, 25) == [1, 1]
        await motors.close()
        assert [board.pin(pin).function for pin in (24, 25)] == ["input", "input"]

    run(main())


@given(command=commands, duty_limit=st.floats(0.01, 1))
def test_what_was_applied_is_what_is_read_back_and_within_the_limit(command: WheelCommand, duty_limit: float) -> None:
    async def main() -> None:
        motors = motors_on(GpioMotorsSettings(17, 18, 22, 23, duty_limit=duty_limit))
        await motors.open()
        applied = await motors.drive(command)
        assert await motors.read_back() == pytest.approx(applied)
        assert max(map(abs, applied)) <= duty_limit * (1 + 1e-12)
        assert applied.left * command.right == pytest.approx(applied.right * command.left)  # the same curve
        if max(map(abs, command)) <= duty_limit:
            assert applied == command
        await motors.close()

    run(main())


@pytest.mark.parametrize("opened", [False, True])
def test_stop_holds_every_pin_low_also_before_open(board: Any, opened: bool) -> None:
    async def main() -> None:
        motors = motors_on()
        if opened:
            await motors.open()
            await motors.drive(WheelCommand(1.0, -1.0))
        await motors.stop()
        assert states(board, 17, 18, 22, 23) == [0, 0, 0, 0]
        assert {board.pin(pin).function for pin in (17, 18, 22, 23)} == {"output"}
        assert await motors.read_back() == STOP
        await motors.close()

    run(main())


def test_stop_and_halt_never_raise_where_another_program_has_the_pins() -> None:
    async def main() -> None:
        other = gpiozero.LED(18)
        motors = motors_on()
        with pytest.raises(NotResponding, match=r"motors on GPIO 17/18 and 22/23: .*GPIO18.*in use"):
            await motors.open()
        await motors.stop()
        motors.halt()
        await motors.close()
        other.close()
        await motors.open()  # what was claimed before the busy pin was let go
        await motors.close()

    run(main())


def test_a_failed_opening_lets_go_of_its_pins_even_while_its_error_is_kept() -> None:
    async def main() -> None:
        other = gpiozero.LED(23)
        motors = motors_on()
        with pytest.raises(NotResponding) as kept:
            await motors.open()
        gpiozero.LED(17).close()
        other.close()
        assert kept.value.__context__ is None

    run(main())


def test_halt_works_from_another_thread(board: Any) -> None:
    async def main() -> None:
        motors = motors_on()
        motors.halt()
        await motors.open()
        await motors.drive(WheelCommand(0.6, 0.6))
        thread = threading.Thread(target=motors.halt)
        thread.start()
        thread.join()
        assert states(board, 17, 18, 22, 23) == [0, 0, 0, 0]
        await motors.close()

    run(main())


def test_opening_again_stops_but_does_not_let_the_pins_float(board: Any) -> None:
    async def main() -> None:
        motors = motors_on()
        await motors.open()
        await motors.drive(WheelCommand(0.6, 0.6))
        held = board.pin(17)
        functions: list[str] = []
        held._set_function = functions.append
        await motors.open()
        assert states(board, 17, 18, 22, 23) == [0, 0, 0, 0]
        assert functions == []
        del held._set_function
        await motors.close()

    run(main())


def test_one_side_that_fails_does_not_keep_the_other_from_stopping(board: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        motors = motors_on()
        await motors.open()
        await motors.drive(WheelCommand(0.6, 0.6))

        def fail(*_: object) -> None:
            raise RuntimeError("lost touch")

        with monkeypatch.context() as broken:
            broken.setattr(motors._sides[0], "stop", fail)
            motors.halt()
            assert states(board, 22, 23) == [0, 0]
        with monkeypatch.context() as broken:
            broken.setattr(board.pin(17), "_set_state", fail)
            with pytest.raises(NotResponding, match="the pins failed: lost touch"):
                await motors.drive(WheelCommand(0.5, 0.5))
        await motors.close()

    run(main())


def test_duties_beyond_full_are_full(board: Any) -> None:
    async def main() -> None:
        motors = motors_on(GpioMotorsSettings(17, 18, 22, 23, duty_limit=0.5))
        await motors.open()
        assert await motors.drive(WheelCommand(inf, 0.1)) == (0.5, 0.05)
        assert await motors.drive(WheelCommand(-7.0, 1.5)) == (-0.5, 0.5)
        assert states(board, 17, 18, 22, 23) == [0, 0.5, 0.5, 0]
        await motors.close()

    run(main())


@pytest.mark.parametrize("broken", [WheelCommand(0.5, nan), WheelCommand(nan, 0.5)])
def test_what_is_no_number_reaches_no_pin(board: Any, broken: WheelCommand) -> None:
    async def main() -> None:
        motors = motors_on()
        await motors.open()
        with pytest.raises(ValueError, match="NaN"):
            await motors.drive(broken)
        assert states(board, 17, 18, 22, 23) == [0, 0, 0, 0]
        await motors.close()

    run(main())


@pytest.mark.parametrize("broken", [17, 22])
def test_a_pin_that_fails_stops_both_sides(board: Any, monkeypatch: pytest.MonkeyPatch, broken: int) -> None:
    async def main() -> None:
        motors = motors_on()
        await motors.open()
        await motors.drive(WheelCommand(0.4, 0.4))
        set_state = board.pin(broken)._set_state

        def only_low(state: float) -> None:
            if state:
                raise RuntimeError("lost touch")
            set_state(state)

        with monkeypatch.context() as failing:
            failing.setattr(board.pin(broken), "_set_state", only_low)
            with pytest.raises(NotResponding, match="lost touch"):
                await motors.drive(WheelCommand(0.6, 0.6))
        assert states(board, 17, 18, 22, 23) == [0, 0, 0, 0]
        await motors.close()

    run(main())


def test_there_is_no_deadman_and_nothing_is_known_of_the_battery() -> None:
    async def main() -> None:
        assert motors_on().deadman_s is None
        assert await motors_on().health() == (None, ())

    run(main())


def test_use_before_open_says_so() -> None:
    async def main() -> None:
        with pytest.raises(NotResponding, match="not open"):
            await motors_on().drive(STOP)
        with pytest.raises(NotResponding, match="not open"):
            await motors_on().read_back()

    run(main())


def test_missing_library_and_missing_board_are_told_apart_with_their_remedies(monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        with monkeypatch.context() as bare:
            bare.setitem(sys.modules, "gpiozero", None)
            with pytest.raises(NotResponding, match=r"pip install '\.\[pi\]'"):
                await motors_on().open()
        with monkeypatch.context() as computer:
            computer.setattr(gpiozero.Device, "pin_factory", None)
            computer.setenv("GPIOZERO_PIN_FACTORY", "none-of-these")
            with pytest.raises(NotResponding, match=r"group gpio.*python3-lgpio"):
                await motors_on().open()

    run(main())


def test_no_pin_library_at_all_is_one_error_and_no_warnings(monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        monkeypatch.setattr(gpiozero.Device, "pin_factory", None)
        monkeypatch.delenv("GPIOZERO_PIN_FACTORY", raising=False)
        for library in ("lgpio", "rpigpio", "pigpio", "native"):
            monkeypatch.setitem(sys.modules, f"gpiozero.pins.{library}", None)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            with pytest.raises(NotResponding, match="Unable to load any default pin factory"):
                await motors_on().open()
        assert told == []

    run(main())


def test_other_warnings_about_pins_are_let_through(monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        motors = motors_on()
        slow = gpiozero.PWMSoftwareFallback("slow")
        monkeypatch.setattr(motors, "_make", lambda gpiozero: warnings.warn(slow, stacklevel=1))
        with pytest.warns(gpiozero.PWMSoftwareFallback, match="slow"):
            await motors.open()

    run(main())
