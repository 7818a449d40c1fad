"""pysabertooth speaks to the chip as to a board.

Its start-up is tolerated: AA twice, command 15, which writes the board's stored baud rate again at each start, and AA
again.
"""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from tests.simhal.chips.bench import BoardBench
from tests.virtual import virtual
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.hal import WheelCommand
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.motor_boards import SabertoothChip

pysabertooth = pytest.importorskip(
    "pysabertooth.PySabertooth", reason="pysabertooth, another implementation, is not installed"
)


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


class Bench(BoardBench[SabertoothChip]):
    """A chip with the library on it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, address: int = 128, *, autobaud: bool = False) -> None:
        super().__init__(partial(SabertoothChip, address=address, autobaud=autobaud))
        self.now_s = 2.0 if autobaud else 0.0  # an old board's start-up time
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


def test_its_start_up_lets_an_old_board_take_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, autobaud=True)
    assert bench.chip.settings == {15: 2}
    bench.library.driveBoth(40, 40)
    assert bench.world.commanded == (50 / 127, 50 / 127)
    del bench.library
    assert bench.world.commanded == (0.0, 0.0)


@pytest.mark.parametrize("address", [128, 130, 135])
@virtual
async def test_both_send_the_same_bytes_for_every_percent(monkeypatch: pytest.MonkeyPatch, address: int) -> None:
    bench = Bench(monkeypatch, address)
    ours: list[bytes] = []
    buses = FakeBuses()
    buses.serial("/dev/serial0").attach(SimpleNamespace(receive=ours.append))
    motors = Sabertooth(SabertoothSettings(address=address), buses)

    await motors.open()
    for percent in range(-100, 101):
        bench.port.written = b""
        bench.library.driveBoth(percent, -percent)
        applied = await motors.drive(WheelCommand(percent / 100, -percent / 100))
        assert bench.port.written == ours[-1][:8], "behind it, our timeout"
        assert bench.world.commanded == applied


def test_its_end_stops_the_motors(bench: Bench) -> None:
    bench.library.driveBoth(40, 40)
    del bench.library
    assert bench.world.commanded == (0.0, 0.0)
    assert not bench.port.is_open
