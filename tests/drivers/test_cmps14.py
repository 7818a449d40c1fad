"""The CMPS14 driver believes what can be true, asks again for what cannot, and says what is wrong."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.angles import wrap180
from wayfarer.drivers.cmps14 import CMPS14, CMPS14Settings, Levels, decode, flaw
from wayfarer.errors import BadReading, NotResponding, WrongPart
from wayfarer.hal import Compass
from wayfarer.simhal.chips.cmps14 import CMPS14Chip
from wayfarer.simhal.fakebus import FakeBuses, FakeI2C
from wayfarer.simhal.loop import VirtualLoop
from wayfarer.simhal.senses import HeadingSense
from wayfarer.testing import check_compass

T = TypeVar("T")
ADDRESS = 0x60
BUS = "/dev/i2c-1"

# The same vectors as in the hardware notes; the rest of each is decoded there by hand.
NOTHING_MEASURED = bytes((7, *bytes(30)))
USUAL = bytes.fromhex("07C20AAEF404012CFF88FE3E0015FF3303D20010FFE000080000FF85002DCF")
EXTREME = bytes.fromhex("07000E0F59A70001FFFF7FFF8000000000 01FFFF0000000100000383FC7DFF")


class Held(HeadingSense):
    """A sense that is held at one heading, pitch and roll, in tenths of a degree; it counts how often it was asked."""

    def __init__(self, heading: int = 2734, pitch: int = -123, roll: int = 45) -> None:
        self.attitude = heading, pitch, roll
        self.samples = 0

    def sample(self, t_s: float) -> tuple[int, int, int]:
        self.samples += 1
        return self.attitude


Trouble = Callable[[bytes], bytes]


class TroubledI2C(FakeI2C):
    """A bus on which the next block reads go wrong, each in its own way; the transfers of one byte go well."""

    troubles: tuple[Trouble, ...] = ()

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        answer = await super().write_read(address, data, count)
        if count > 1 and self.troubles:
            trouble, *rest = self.troubles
            self.troubles = tuple(rest)
            return trouble(answer)
        return answer


class OneBus(FakeBuses):
    """Buses of which one is given."""

    def __init__(self, bus: FakeI2C) -> None:
        super().__init__()
        self.bus = bus

    def i2c(self, name: str) -> FakeI2C:
        assert name == self.bus.name
        return self.bus


@dataclass
class Bench:
    """A chip on a bus that can be troubled, and the driver that speaks to it."""

    sense: Held = field(default_factory=Held)
    settings: CMPS14Settings = CMPS14Settings()
    firmware: int = 7
    boot_s: float = 0.0

    def __post_init__(self) -> None:
        self.bus = TroubledI2C(self.settings.bus)
        clock = asyncio.get_running_loop().time
        self.chip = CMPS14Chip(self.sense, clock, firmware=self.firmware, boot_s=self.boot_s)
        self.bus.attach(self.settings.address, self.chip)
        self.compass = CMPS14(self.settings, OneBus(self.bus))

    async def opened(self) -> CMPS14:
        await self.compass.open()
        return self.compass


def run(main: Callable[[], Awaitable[T]]) -> T:
    async def run_main() -> T:
        return await main()

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(run_main())


def nack(answer: bytes) -> bytes:
    raise NotResponding("no acknowledgement")


def swapped_bearing(answer: bytes) -> bytes:
    return answer[:2] + answer[3:1:-1] + answer[4:]


def with_bytes(position: int, *values: int) -> Trouble:
    return lambda answer: answer[:position] + bytes(values) + answer[position + len(values) :]


def bit_shifted(answer: bytes) -> bytes:
    bits = int.from_bytes(answer, "big") << 1
    return bits.to_bytes(len(answer) + 1, "big")[1:]


def like_cmps12(answer: bytes) -> bytes:
    """Move pitch to where roll was, and put a bearing of 273.4 degrees, in sixteenths, where pitch was."""
    return with_bytes(0x1A, *round(273.4 * 16).to_bytes(2, "big"), *answer[0x1A:0x1C])(answer)


# -- decoding ----------------------------------------------------------------------------------------------------


def test_usual_block_is_decoded() -> None:
    block = decode(USUAL)
    assert flaw(block, 7) is None
    assert (block.version, block.bearing_deg, block.bearing8_deg) == (7, 273.4, 272.8125)
    assert (block.pitch8_deg, block.roll8_deg, block.pitch_deg, block.roll_deg) == (-12, 4, -12.3, 4.5)
    assert (block.mag, block.accel, block.gyro) == ((300, -120, -450), (21, -205, 978), (16, -32, 8))
    assert block.levels == Levels(system=3, gyro=0, accel=3, mag=3)


def test_extreme_block_is_decoded() -> None:
    block = decode(EXTREME)
    assert flaw(block, 7) is None
    assert (block.bearing_deg, block.bearing8_deg) == (359.9, 0.0)
    assert (block.pitch8_deg, block.roll8_deg, block.pitch_deg, block.roll_deg) == (89, -89, 89.9, -89.9)
    assert (block.mag, block.accel, block.gyro) == ((1, -1, 32767), (-32768, 0, 1), (-1, 0, 1))
    assert block.levels == Levels(3, 3, 3, 3)


def test_block_without_gravity_cannot_be_true() -> None:
    assert "no gravity" in str(flaw(decode(NOTHING_MEASURED), 7))


def test_north_can_be_true() -> None:
    north = with_bytes(1, 0, 0, 0)(USUAL)
    assert flaw(decode(north), 7) is None
    assert decode(north).bearing_deg == 0.0


@pytest.mark.parametrize("level", [bytes(31), b"\xff" * 31])
def test_silent_line_cannot_be_true(level: bytes) -> None:
    assert "nobody drives the line" in str(flaw(decode(level), level[0]))


def test_bearing_of_a_whole_turn_cannot_be_true() -> None:
    assert "360.0" in str(flaw(decode(with_bytes(1, 0x00, 0x0E, 0x10)(USUAL)), 7))


@pytest.mark.parametrize(("high", "low", "tenths"), [(0xFF, 0xFF, -1), (0xFF, 0x85, -123), (0xFC, 0x7C, -900)])
def test_negative_tilt_is_twos_complement(high: int, low: int, tenths: int) -> None:
    block = decode(with_bytes(0x1A, high, low, high, low)(USUAL))
    assert (block.pitch_deg, block.roll_deg) == (tenths / 10, tenths / 10)


def test_negative_tilt_in_eight_bits_is_signed() -> None:
    block = decode(with_bytes(4, 0xA6, 0xFF)(USUAL))
    assert (block.pitch8_deg, block.roll8_deg) == (-90, -1)


def test_old_firmware_gives_pitch_in_whole_degrees() -> None:
    block = decode(with_bytes(0, 4)(with_bytes(0x1A, 0, 0)(USUAL)))
    assert flaw(block, 4) is None
    assert (block.pitch_deg, block.roll_deg) == (-12.0, 4.5)


@pytest.mark.parametrize(
    ("position", "values", "why"),
    [
        (0x04, (0xA5,), "pitch"),  # -91, and -91.0 below
        (0x1A, (0x03, 0x85), "pitch"),
        (0x1A, (0xFF, 0x75), "pitch"),  # 1.9 degrees from -12
        (0x1C, (0x07, 0x09), "roll"),  # 180.1
        (0x1C, (0x00, 0x38), "roll"),  # 1.6 degrees from 4
        (0x05, (0x7F,), "roll"),
    ],
)
def test_tilt_that_contradicts_itself_cannot_be_true(position: int, values: tuple[int, ...], why: str) -> None:
    assert str(flaw(decode(with_bytes(position, *values)(USUAL)), 7)).startswith(why)


@given(st.integers(0, 3599), st.integers(-900, 900), st.integers(-1800, 1800))
def test_what_the_chip_says_can_be_true(heading: int, pitch: int, roll: int) -> None:
    chip = CMPS14Chip(Held(heading, pitch, roll), lambda: 0.0)
    chip.write(b"\x00")
    assert flaw(decode(chip.read(31)), 7) is None


@given(st.integers(0, 3599), st.integers(-900, 900), st.integers(-900, 900))
def test_block_shifted_by_a_bit_cannot_be_true(heading: int, pitch: int, roll: int) -> None:
    chip = CMPS14Chip(Held(heading, pitch, roll), lambda: 0.0)
    chip.write(b"\x00")
    assert flaw(decode(bit_shifted(chip.read(31))), 7) is not None


@pytest.mark.parametrize("cut_off", [False, True])
def test_swapped_bearings_cannot_be_true(cut_off: bool) -> None:
    for heading in range(3600):
        bearing8 = (heading * 256 // 3600) if cut_off else round(heading * 256 / 3600) % 256
        block = with_bytes(1, bearing8, *heading.to_bytes(2, "big"))(USUAL)
        assert flaw(decode(block), 7) is None
        alike = heading >> 8 == heading & 0xFF
        assert (flaw(decode(swapped_bearing(block)), 7) is None) == alike


@given(st.integers(0, 3599), st.integers(1, 30), st.integers(0, 255))
def test_block_shifted_by_a_byte_cannot_be_true(heading: int, at: int, extra: int) -> None:
    """A byte too many or too few before the end of the bearing; later ones reach tilt, which is not always told."""
    at = min(at, 2)
    chip = CMPS14Chip(Held(heading, -123, 45), lambda: 0.0)
    chip.write(b"\x00")
    block = chip.read(31)
    shifted = (block[:at] + bytes((extra,)) + block[at:])[:31]
    if shifted[:4] != block[:4]:
        assert flaw(decode(shifted), 7) is not None
