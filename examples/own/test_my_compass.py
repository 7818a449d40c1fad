"""The tests of my_compass.py, and the simulated chip that they and ``wayfarer sim --depth bus`` drive it with."""

import asyncio
from collections.abc import Callable
from math import degrees
from pathlib import Path
from struct import pack

import pytest
from my_compass import MyCompass, MyCompassSettings

import wayfarer
from wayfarer.errors import BadReading, WrongPart
from wayfarer.testing import Check, ChipWiring, FakeBuses, RegisterChip, SimulatedChip, checks_of

FILE = Path(__file__).with_name("my_compass.py")

# -- the chip, written from the data sheet and not from the driver: a mistake in one of them shows in the other --------


def attach(settings: MyCompassSettings, wiring: ChipWiring) -> None:
    """Put a chip on the simulated bus, at the address that the settings name; it feels the simulated rover turn."""

    def measure(_registers: range) -> None:
        wiring.world.advance_to(wiring.sense_clock())
        heading_rad, pitch_deg, roll_deg = wiring.world.attitude()
        heading = round(degrees(heading_rad) * 10.0) % 3600
        chip.put(0x10, pack(">HhhB", heading, round(pitch_deg * 10.0), round(roll_deg * 10.0), 3))

    chip = chip_with(identity=0x9C, before_read=measure)
    wiring.buses.i2c(settings.bus).attach(settings.address, chip)


def chip_with(
    identity: int, block: bytes = bytes(7), before_read: Callable[[range], None] | None = None
) -> RegisterChip:
    """Return a chip with these registers; it refuses what the data sheet does not name."""
    registers = {0x0F: identity, **dict(enumerate(block, 0x10))}
    return RegisterChip("MyCompass", registers, read_only=registers, before_read=before_read)


CHIP = SimulatedChip(attach)

# -- the tests ---------------------------------------------------------------------------------------------------------


def compass(chip: RegisterChip | None) -> MyCompass:
    """Return the driver on a bus with this chip, or with none."""
    settings, buses = MyCompassSettings(), FakeBuses()
    if chip is not None:
        buses.i2c(settings.bus).attach(settings.address, chip)
    return MyCompass(settings, buses)


PROMISES = checks_of("compass", lambda: compass(chip_with(identity=0x9C)), unreachable=lambda: compass(None))


@pytest.mark.parametrize("check", PROMISES, ids=str)
def test_it_keeps_each_promise_of_a_compass(check: Check) -> None:
    asyncio.run(check.run())


def test_it_reads_what_the_data_sheet_gives_as_an_example() -> None:
    east = compass(chip_with(0x9C, bytes.fromhex("0384 0032 FFCE 03")))
    reading = asyncio.run(east.read())
    assert (reading.heading_deg, reading.pitch_deg, reading.roll_deg, reading.calibration) == (90.0, 5.0, -5.0, 3)


def test_it_does_not_take_another_part_or_garbage() -> None:
    with pytest.raises(WrongPart):
        asyncio.run(compass(chip_with(identity=0x33)).open())
    with pytest.raises(BadReading):
        asyncio.run(compass(chip_with(0x9C, b"\xff" * 7)).read())


def test_a_rover_drives_with_it() -> None:
    results = wayfarer.run_campaign(trials=2, rover="forestrover", depth="bus", set={"parts.compass.driver": str(FILE)})
    assert [row["outcome"] for row in results.trials] == ["escaped"] * 2
