"""The maker's own Python library, and our driver over pyserial, speak to the chip at the other end of a real line.

basicmicro takes any byte as an acknowledgement, and gives counters without their sign.
"""

from __future__ import annotations

import os
import pty
import select
import threading
import tty
from collections.abc import Iterator
from typing import Any

import pytest

from tests.simhal.clearing import steady_world
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.drivers.roboclaw import RoboClaw, RoboClawSettings
from wayfarer.hal import STOP, WheelCommand
from wayfarer.simhal.chips.roboclaw import RoboClawChip

basicmicro = pytest.importorskip("basicmicro", reason="basicmicro, another implementation, is not installed")
pytestmark = pytest.mark.process  # a thread carries bytes in real time

ADDRESS = 0x80
POLL_S = 0.05


class Line:
    """A pty at ``path`` with a RoboClaw at its far end, whose clock stands still."""

    def __init__(self) -> None:
        self.world = steady_world()
        self.chip = RoboClawChip(self.world, lambda: 0.0)
        self._far, self._near = pty.openpty()
        tty.setraw(self._near)
        self.path = os.ttyname(self._near)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._carry, name="RoboClaw line")
        self._thread.start()

    def _carry(self) -> None:
        while not self._over.is_set():
            if select.select([self._far], [], [], POLL_S)[0]:
                os.write(self._far, self.chip.receive(os.read(self._far, 1024)))

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        os.close(self._far)
        os.close(self._near)


@pytest.fixture
def line() -> Iterator[Line]:
    line = Line()
    yield line
    line.close()


@pytest.fixture
def library(line: Line) -> Iterator[Any]:
    library = basicmicro.Basicmicro(line.path, 38400)
    assert library.Open()
    yield library
    library.close()


def test_library_drives_and_is_told_what_is_applied(line: Line, library: Any) -> None:
    for first, second in ((16384, -16384), (-32767, 32767), (0, 0)):
        assert library.DutyM1M2(ADDRESS, first, second)
        assert line.chip.levels == (first, second)
        assert library.ReadPWMs(ADDRESS) == (True, first, second)


def test_library_understands_every_answer(line: Line, library: Any) -> None:
    assert library.ReadVersion(ADDRESS) == (True, "USB Roboclaw 2x15a v4.1.34\n")
    assert library.SetTimeout(ADDRESS, 0.5)
    assert library.GetTimeout(ADDRESS) == (True, 0.5)
    assert library.ReadMainBatteryVoltage(ADDRESS) == (True, 126)
    line.chip.counters_began = (-7, 1)
    assert library.GetEncoders(ADDRESS) == (True, 7, 2**32 - 1)
    assert library.ReadCurrents(ADDRESS) == (True, 0, 0)
    line.chip.status = 0x00010001
    assert library.ReadError(ADDRESS) == (True, 0x00010001)
    assert line.chip.dropped == 0


async def test_driver_over_a_real_serial_port_opens_drives_and_halts(line: Line) -> None:
    buses = LinuxBuses()
    motors = RoboClaw(RoboClawSettings(port=line.path), buses)
    await motors.open()
    assert line.chip.timeout == 2
    applied = await motors.drive(WheelCommand(0.5, -0.25))
    assert line.world.commanded == applied == await motors.read_back()
    motors.halt()
    assert await motors.read_back() == STOP  # behind three acknowledgements
    assert (await motors.health()).battery_v == 12.6
    await buses.close()
