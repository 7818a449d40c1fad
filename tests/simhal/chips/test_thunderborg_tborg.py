"""python-thunderborg speaks to the chip and hears from it what our driver does.

The library opens the bus device itself, so it is given streams that end in the chip. Its flaw, which does not show here
because the chip always echoes: after three answers to something else it takes the last of them for the right one.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.chips.bench import BoardBench
from wayfarer.drivers.thunderborg import ThunderBorg, ThunderBorgSettings
from wayfarer.drivers.thunderborg_board import ThunderBorgLight, ThunderBorgLightSettings
from wayfarer.errors import PowerLost
from wayfarer.hal import Colour, WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.motor_boards import ThunderBorgChip
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

tborg = pytest.importorskip("tborg.tborg", reason="python-thunderborg, another implementation, is not installed")

# Less than one level back is reverse 0 to the library and forward 0 to us; both stand still.
STILL = {b"\x09\x00": b"\x08\x00", b"\x0c\x00": b"\x0b\x00"}


class Stream:
    """A bus device that ends in a chip."""

    def __init__(self, chip: ThunderBorgChip) -> None:
        self.write = chip.write
        self.read = chip.read

    def close(self) -> None:
        pass


class Bench(BoardBench[ThunderBorgChip]):
    """One chip with our drivers and the library on it."""

    def __init__(self) -> None:
        super().__init__(partial(ThunderBorgChip, full_level=255.0))
        buses = FakeBuses()
        buses.i2c("/dev/i2c-1").attach(0x15, self.chip)
        self.motors = ThunderBorg(ThunderBorgSettings(duty_limit=1.0), buses)
        self.light = ThunderBorgLight(ThunderBorgLightSettings(), buses)
        self.library: Any = tborg.ThunderBorg(logger_name="tborg", static_init=True)
        self.library._i2c_read = self.library._i2c_write = Stream(self.chip)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def run() -> Iterator[Any]:
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        yield runner.run


def test_the_library_finds_the_board_by_itself(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    addressed = []
    monkeypatch.setattr(tborg, "io", SimpleNamespace(open=lambda *_, **__: Stream(bench.chip)))
    monkeypatch.setattr(tborg, "fcntl", SimpleNamespace(ioctl=lambda _, request, address: addressed.append(address)))
    tborg.ThunderBorg(logger_name="tborg").set_comms_failsafe(True)
    assert addressed == [0x15, 0x15]
    assert bench.chip.failsafe


@given(left=st.floats(-1.0, 1.0), right=st.floats(-1.0, 1.0))
def test_both_send_the_same_bytes_for_the_same_duties(left: float, right: float) -> None:
    bench = Bench()
    bench.library.set_motor_two(left)
    bench.library.set_motor_one(right)
    theirs = list(bench.chip.writes)
    bench.chip.writes.clear()
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(bench.motors.open())
        bench.chip.writes.clear()
        applied = runner.run(bench.motors.drive(WheelCommand(left, right)))
    driven = [written for written in bench.chip.writes if len(written) > 1]  # a request is a command alone
    assert driven == [STILL.get(written, written) for written in theirs]
    assert (bench.library.get_motor_two(), bench.library.get_motor_one()) == applied


def test_each_reads_what_the_other_drives(bench: Bench, run: Any) -> None:
    run(bench.motors.open())
    applied = run(bench.motors.drive(WheelCommand(0.7, -0.4)))
    assert (bench.library.get_motor_two(), bench.library.get_motor_one()) == applied
    bench.library.set_both_motors(-0.6)
    assert run(bench.motors.read_back()) == (-0.6, -0.6)
    bench.library.halt_motors()
    assert run(bench.motors.read_back()) == (0.0, 0.0)


def test_each_sees_the_failsafe_that_the_other_arms_and_that_it_trips(bench: Bench, run: Any) -> None:
    assert bench.library.get_comms_failsafe() is False
    run(bench.motors.open())
    assert bench.library.get_comms_failsafe() is True
    bench.library.set_both_motors(0.5)
    bench.now_s = 0.3
    assert bench.library.get_motor_one() == 0.0
    bench.library.set_comms_failsafe(False)
    with pytest.raises(PowerLost):
        run(bench.motors.drive(WheelCommand(0.5, 0.5)))
    assert bench.library.get_comms_failsafe() is True


@pytest.mark.parametrize("volts", [7.2, 12.0, 14.0, 36.3])
def test_both_read_the_same_voltage(bench: Bench, run: Any, volts: float) -> None:
    bench.chip.volts = volts
    assert run(bench.motors.health()).battery_v == bench.library.get_battery_voltage()


def test_both_see_the_same_drive_faults(bench: Bench, run: Any) -> None:
    run(bench.motors.open())
    assert bench.library.get_drive_fault_one() and bench.library.get_drive_fault_two()
    bench.library.set_both_motors(0.3)
    assert not bench.library.get_drive_fault_one() and not bench.library.get_drive_fault_two()
    run(bench.motors.drive(WheelCommand(0.3, 0.3)))
    bench.chip.drive_faults.add(1)
    assert bench.library.get_drive_fault_two()
    assert "motor B (left)" in run(bench.motors.health()).faults[0]


def test_the_library_reads_the_colours_that_the_light_shows(bench: Bench, run: Any) -> None:
    assert bench.library.get_led_battery_state() is True
    run(bench.light.open())
    run(bench.light.show(Colour(1.0, 0.2, 0.0)))
    assert bench.library.get_led_one() == bench.library.get_led_two() == (1.0, 0.2, 0.0)
    assert bench.library.get_led_battery_state() is False
