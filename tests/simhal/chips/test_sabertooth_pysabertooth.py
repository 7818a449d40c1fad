"""pysabertooth speaks to the chip as to a board.

Its start-up is tolerated: AA twice, command 15, which writes the board's stored baud rate anew at each start, and AA
again.
"""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.escape.api import Vehicle
from wayfarer.hal import WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.sabertooth import SabertoothChip
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

pysabertooth = pytest.importorskip(
    "pysabertooth.PySabertooth", reason="pysabertooth, another implementation, is not installed"
)

CLEARING = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ())


class Port:
    """Stands in for ``serial.Serial``: a port that ends in a chip, and keeps what was written."""

    def __init__(self, chip: SabertoothChip) -> None:
        self.chip = chip
        self.is_open = False
        self.written = b""

    def open(self) -> None:
        self.is_open = True

    def write(self, data: bytes) -> None:
        self.written += data
        self.chip.receive(data)

    def flush(self) -> None:
        pass

    def close(self) -> None:
        self.is_open = False


class Bench:
    """A chip with the library on it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, address: int = 128) -> None:
        self.now_s = 0.0
        self.world = World(CLEARING, Vehicle(0.4, 0.4, 0.5, 1.4), Physics(), RandomStreams(0))
        self.chip = SabertoothChip(self.world, lambda: self.now_s, address=address)
        self.port = Port(self.chip)
        monkeypatch.setattr(pysabertooth, "serial", SimpleNamespace(Serial=lambda: self.port))
        monkeypatch.setattr(pysabertooth, "time", SimpleNamespace(sleep=lambda _: None))
        self.library: Any = pysabertooth.Sabertooth("/dev/serial0", 9600, address)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_its_start_up_stores_the_baud_rate_and_moves_nothing(bench: Bench) -> None:
    assert bench.port.written == bytes.fromhex("AA AA 80 0F 02 11 AA")
    assert bench.chip.settings == {15: 2}
    assert bench.chip.dropped == 0
    assert bench.world.commanded == (0.0, 0.0)


def test_half_speed_is_cut_off(bench: Bench) -> None:
    bench.port.written = b""
    bench.library.driveBoth(50, -100)
    assert bench.port.written == bytes.fromhex("80 00 3F 3F 80 05 7F 04")
    assert bench.world.commanded == (63 / 127, -1.0)


@pytest.mark.parametrize("address", [128, 130, 135])
def test_both_send_the_same_bytes_for_every_percent(monkeypatch: pytest.MonkeyPatch, address: int) -> None:
    bench = Bench(monkeypatch, address)
    ours: list[bytes] = []
    buses = FakeBuses()
    buses.serial("/dev/serial0").chip = SimpleNamespace(receive=ours.append)
    motors = Sabertooth(SabertoothSettings(address=address), buses)

    async def drive_all() -> None:
        await motors.open()
        for percent in range(-100, 101):
            bench.port.written = b""
            bench.library.driveBoth(percent, -percent)
            applied = await motors.drive(WheelCommand(percent / 100, -percent / 100))
            assert bench.port.written == ours[-1][:8], "behind it, our timeout"
            assert bench.world.commanded == applied

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(drive_all())


def test_mixed_commands_steer(bench: Bench) -> None:
    bench.library.sendCommand(bench.library.FORWARD_MIXED, 64)
    assert bench.world.commanded == (0.0, 0.0)
    bench.library.sendCommand(bench.library.RIGHT_MIXED, 32)
    assert bench.world.commanded == (96 / 127, 32 / 127)


def test_a_timeout_that_it_sets_trips(bench: Bench) -> None:
    bench.library.sendCommand(14, 5)
    bench.library.driveBoth(40, 40)
    bench.now_s = 0.49
    bench.chip.tick()
    assert bench.world.commanded != (0.0, 0.0)
    bench.now_s = 0.51
    bench.chip.tick()
    assert bench.world.commanded == (0.0, 0.0)


def test_its_end_stops_the_motors(bench: Bench) -> None:
    bench.library.driveBoth(40, 40)
    del bench.library
    assert bench.world.commanded == (0.0, 0.0)
    assert not bench.port.is_open
