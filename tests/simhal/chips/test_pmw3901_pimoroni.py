"""Pimoroni's own library, written without knowledge of the simulated chip, starts it and reads it."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from tests.simhal.chips.bench import Clock, Driven
from tests.virtual import virtual
from wayfarer.drivers.pmw3901 import PMW3901, PMW3901Settings
from wayfarer.simhal.buses import FakeBuses, SPIChip
from wayfarer.simhal.chips.pmw3901 import PMW3901Chip

pmw3901 = pytest.importorskip("pmw3901", reason="Pimoroni's pmw3901 is not installed, or its gpiod and gpiodevice")

INIT_WRITES = 94  # with 67=80 and 73=00: docs/reference/hardware.md


class Peer:
    """Pimoroni's library on a chip, its sleeps on the chip's own clock."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock, self._monkeypatch = Clock(), monkeypatch
        monkeypatch.setattr(pmw3901, "time", SimpleNamespace(time=self.clock, sleep=self._sleep))

    def _sleep(self, seconds_s: float) -> None:
        self.clock.t_s += seconds_s

    def chip(self, *displacements: tuple[int, int], **factory: int) -> PMW3901Chip:
        """Return a chip; ``factory`` names registers of bank 0E, such as ``r67``."""
        registers = {(0x0E, int(name[1:], 16)): value for name, value in factory.items()}
        return PMW3901Chip(Driven(*displacements), self.clock, factory=registers)

    def open(self, chip: SPIChip) -> Any:
        """Return the library's own object, started on the chip."""
        device = SimpleNamespace(
            open=lambda port, chip_select: None,
            xfer2=lambda data: list(chip.exchange(bytes(data))),
        )
        self._monkeypatch.setattr(pmw3901, "spidev", SimpleNamespace(SpiDev=lambda: device))
        return pmw3901.PMW3901()


@pytest.fixture
def peer(monkeypatch: pytest.MonkeyPatch) -> Peer:
    return Peer(monkeypatch)


def test_peer_starts_the_chip_and_knows_it(peer: Peer) -> None:
    chip = peer.chip(r67=0x80, r73=0x00)
    assert peer.open(chip).get_id() == [0x49, 0x01]
    assert len(chip.writes) == INIT_WRITES


@virtual
async def test_peer_and_driver_write_the_same_but_for_what_is_known(peer: Peer) -> None:
    chip = peer.chip()
    peer.open(chip)
    buses, driven = FakeBuses(), PMW3901Chip(Driven(), asyncio.get_running_loop().time)
    buses.spi("/dev/spidev0.1").attach(driven)
    await PMW3901(PMW3901Settings(), buses).open()
    theirs, ours = chip.writes, list(driven.writes)
    assert ours[0] == (0x7F, 0x00)  # a bank that an earlier opening left; they have no such write
    assert ours[-1] == (0x15, 0x00)  # the check that the chip runs; they have none
    differences = [pair for pair in zip(theirs, ours[1:-1], strict=True) if pair[0] != pair[1]]
    assert differences == [
        ((0x70, 0x2D), (0x70, 0x22)),  # their double addition, below
        ((0x74, 0x21), (0x74, 0x1F)),  # their demo kit's value, and the data sheet's
    ]


@pytest.mark.parametrize(("c1", "c1_written"), [(14, 28), (15, 40), (20, 45), (28, 53), (29, 40)])
def test_chip_bears_the_peers_double_addition(peer: Peer, c1: int, c1_written: int) -> None:
    """For c1 of 15 to 28 the library adds 14 and then, its second ``if`` not being an ``elif``, 11 more."""
    chip = peer.chip((3, 0), r70=c1, r71=100)
    library = peer.open(chip)
    assert (0x70, c1_written) in chip.writes
    assert (0x71, 0x2D) in chip.writes
    assert library.get_motion() == (0, -3)


def test_peer_leaves_the_trims_of_a_chip_that_has_some(peer: Peer) -> None:
    chip = peer.chip(r73=0x01)
    peer.open(chip)
    assert len(chip.writes) == INIT_WRITES - 6


def test_peer_reads_the_displacement_by_burst_and_by_register(peer: Peer) -> None:
    library = peer.open(peer.chip((100, 7), (-300, -2)))
    assert library.get_motion() == (7, -100)
    assert library.get_motion_slow() == (-2, 300)


def test_peer_sees_the_counts_turn_with_its_rotation(peer: Peer) -> None:
    library = peer.open(peer.chip(*[(5, 2)] * 4))
    seen = []
    for degrees in (0, 90, 180, 270):
        library.set_rotation(degrees)
        seen.append(library.get_motion())
    assert seen == [(2, 5), (-5, 2), (-2, -5), (5, -2)]
