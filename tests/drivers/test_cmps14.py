"""The CMPS14 driver believes what can be true, asks again for what cannot, and says what is wrong."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.boards import now_s
from tests.simhal.chips.bench import Held
from tests.virtual import virtual
from wayfarer.angles import wrap180
from wayfarer.drivers.cmps14 import CMPS14, OPEN_S, CMPS14Settings
from wayfarer.drivers.cmps14_registers import CalibrationLevels, decode, flaw
from wayfarer.errors import BadReading, NotResponding, WrongPart
from wayfarer.simhal.buses import FakeBuses, FakeI2C
from wayfarer.simhal.chips.cmps14 import CMPS14Chip
from wayfarer.testing import check_compass

# Computed by hand from the register map.
NOTHING_MEASURED = bytes((7, *bytes(30)))
USUAL = bytes.fromhex(
    "07 C2 0A AE F4 04  01 2C FF 88 FE 3E  00 15 FF 33 03 D2  00 10 FF E0 00 08  00 00 FF 85 00 2D CF"
)
Trouble = Callable[[bytes], bytes]


ATTITUDE = (2734, -123, 45)  # heading, pitch and roll of ``USUAL``, in tenths of a degree


class TroubledI2C(FakeI2C):
    """The next block reads go wrong as told, those of one byte go well."""

    troubles: tuple[Trouble, ...] = ()
    writes_left: int | None = None  # until one is not acknowledged

    async def write(self, address: int, data: bytes) -> None:
        if self.writes_left is not None:
            self.writes_left = self.writes_left - 1 if self.writes_left else None
            if self.writes_left is None:
                raise NotResponding("no acknowledgement")
        await super().write(address, data)

    async def write_read(self, address: int, data: bytes, count: int) -> bytes:
        answer = await super().write_read(address, data, count)
        if count > 1 and self.troubles:
            trouble, *rest = self.troubles
            self.troubles = tuple(rest)
            return trouble(answer)
        return answer


class Bench:
    """A chip on a bus that can be troubled, and the driver that speaks to it."""

    def __init__(self, *attitude: int, firmware: int = 7, boot_s: float = 0.0, **settings: object) -> None:
        given = CMPS14Settings(**settings)  # type: ignore[arg-type]
        self.sense = Held(*(attitude or ATTITUDE))
        self.chip = CMPS14Chip(self.sense, now_s, firmware=firmware, boot_s=boot_s)
        buses = FakeBuses()
        self.bus = buses._i2c[given.bus] = TroubledI2C(given.bus)
        self.bus.attach(given.address, self.chip)
        self.compass = CMPS14(given, buses)

    async def opened(self) -> CMPS14:
        await self.compass.open()
        return self.compass


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


def block_of(heading: int, pitch: int = -123, roll: int = 45) -> bytes:
    chip = CMPS14Chip(Held(heading, pitch, roll), lambda: 0.0)
    chip.write(b"\x00")
    return chip.read(31)


# -- decoding ----------------------------------------------------------------------------------------------------


def test_usual_block_is_decoded() -> None:
    block = decode(USUAL)
    assert flaw(block, 7) is None
    assert (block.version, block.bearing_deg, block.bearing8_deg) == (7, 273.4, 272.8125)
    assert (block.pitch8_deg, block.roll8_deg, block.pitch_deg, block.roll_deg) == (-12, 4, -12.3, 4.5)
    assert (block.mag, block.accel, block.gyro) == ((300, -120, -450), (21, -205, 978), (16, -32, 8))
    assert block.levels == CalibrationLevels(system=3, gyro=0, accel=3, mag=3)


@pytest.mark.parametrize(
    ("block", "why"),
    [
        (NOTHING_MEASURED, "the accelerometer measures no gravity"),
        (bytes(31), "firmware reads 0x00: the line is not driven"),
        (b"\xff" * 31, "firmware reads 0xFF: the line is not driven"),
        (with_bytes(1, 0x00, 0x0E, 0x10)(USUAL), "bearing 360.0"),
        (with_bytes(0x1A, 0x03, 0x85)(USUAL), "pitch"),
        (with_bytes(0x1A, 0xFF, 0x75)(USUAL), "pitch"),  # 1.9 degrees from -12
        (with_bytes(0x1A, 0xFC, 0x7B)(with_bytes(0x04, 0xA6)(USUAL)), "pitch"),  # -90.1 and -90
        (with_bytes(0x1C, 0x07, 0x09)(USUAL), "roll"),  # 180.1
        (with_bytes(0x1C, 0x00, 0x38)(USUAL), "roll"),  # 1.6 degrees from 4
        (with_bytes(0x1C, 0x03, 0x7A)(USUAL), "roll"),  # 89.0, as far as the 8 bits reach
        (with_bytes(0x05, 0x7F)(USUAL), "roll"),
    ],
)
def test_what_cannot_be_true_is_told(block: bytes, why: str) -> None:
    assert str(flaw(decode(block), block[0])).startswith(why)


@given(st.integers(0, 3599), st.integers(-900, 900), st.integers(-1800, 1800))
def test_what_the_chip_says_can_be_true(heading: int, pitch: int, roll: int) -> None:
    assert flaw(decode(block_of(heading, pitch, roll)), 7) is None


@given(st.integers(0, 3599), st.integers(-900, 900), st.integers(-900, 900))
def test_block_shifted_by_a_bit_cannot_be_true(heading: int, pitch: int, roll: int) -> None:
    assert flaw(decode(bit_shifted(block_of(heading, pitch, roll))), 7) is not None


@pytest.mark.parametrize("cut_off", [False, True])
def test_swapped_bearings_cannot_be_true(cut_off: bool) -> None:
    for heading in range(3600):
        bearing8 = (heading * 256 // 3600) if cut_off else round(heading * 256 / 3600) % 256
        block = with_bytes(1, bearing8, *heading.to_bytes(2, "big"))(USUAL)
        assert flaw(decode(block), 7) is None
        alike = heading >> 8 == heading & 0xFF
        assert (flaw(decode(swapped_bearing(block)), 7) is None) == alike


@given(st.integers(0, 3599), st.sampled_from((1, 2)), st.integers(0, 255))
def test_block_with_a_byte_too_many_before_the_bearing_cannot_be_true(heading: int, at: int, extra: int) -> None:
    block = block_of(heading)
    assert flaw(decode(block[:at] + bytes((extra,)) + block[at:-1]), 7) is not None


# -- opening -----------------------------------------------------------------------------------------------------


@virtual
async def test_keeps_what_a_compass_promises() -> None:
    await check_compass(lambda: Bench().compass, lambda: CMPS14(CMPS14Settings(), FakeBuses()))


@virtual
async def test_opening_takes_one_sample_and_tells_the_firmware() -> None:
    bench = Bench(bus="/dev/i2c-3", address=0x61)
    assert (bench.sense.asked_s, bench.compass.name) == ([], "CMPS14 at 0x61 on /dev/i2c-3")
    await bench.opened()
    assert (len(bench.sense.asked_s), bench.compass.name) == (1, "CMPS14 firmware 7 at 0x61 on /dev/i2c-3")


@virtual
async def test_nobody_at_the_address_names_bus_address_and_wiring() -> None:
    compass = CMPS14(CMPS14Settings(address=0x67), FakeBuses())
    with pytest.raises(NotResponding, match=r"CMPS14 at 0x67 on /dev/i2c-1: .*check power.*mode pin"):
        await compass.open()


@pytest.mark.parametrize("level", [0x00, 0xFF])
@virtual
async def test_no_firmware_number_is_another_part(level: int) -> None:
    with pytest.raises(WrongPart, match=rf"expected a firmware number, got 0x{level:02X}"):
        await Bench(firmware=level).opened()


@virtual
async def test_map_of_a_cmps12_is_another_part() -> None:
    bench = Bench()
    bench.bus.troubles = (like_cmps12,) * 10
    with pytest.raises(WrongPart, match=r"expected a CMPS14, got pitch 437\.4 at 0x1A and -12 at 0x04, .* CMPS12"):
        await bench.opened()


@virtual
async def test_waits_while_the_part_boots() -> None:
    bench = Bench(boot_s=0.75)
    bench.chip.power_cycle()
    await bench.opened()
    assert now_s() == pytest.approx(0.8 + OPEN_S)
    assert len(bench.sense.asked_s) == 1


@virtual
async def test_part_that_never_boots_is_given_up_after_a_second() -> None:
    bench = Bench(boot_s=60.0)
    bench.chip.power_cycle()
    with pytest.raises(BadReading, match="no gravity"):
        await bench.opened()
    assert now_s() == pytest.approx(1.0)


@virtual
async def test_one_lost_transfer_does_not_keep_it_from_opening_and_two_do_once() -> None:
    bench = Bench()
    bench.bus.troubles = (nack, nack)
    with pytest.raises(NotResponding):
        await bench.opened()
    bench.bus.troubles = (nack,)
    assert (await (await bench.opened()).read()).heading_deg == 273.4


@pytest.mark.parametrize(("background", "left_at"), [(False, 0x80), (True, 0x93)])
@virtual
async def test_opening_switches_background_calibration_off_unless_it_is_wanted(background: bool, left_at: int) -> None:
    bench = Bench(background_calibration=background)
    bench.chip.config = 0x93
    await bench.opened()
    assert bench.chip.config == left_at


# -- reading -----------------------------------------------------------------------------------------------------


@given(st.integers(0, 3599), st.integers(-900, 900), st.integers(-1800, 1800))
@virtual
async def test_attitude_comes_through_as_it_is(heading: int, pitch: int, roll: int) -> None:
    bench = Bench(heading, pitch, roll)
    compass = await bench.opened()
    await asyncio.sleep(0.5)
    assert await compass.read() == (0.5 + OPEN_S, heading / 10, pitch / 10, roll / 10, 3)
    assert len(bench.sense.asked_s) == 2


@given(st.integers(0, 3599), st.floats(-180, 180))
@virtual
async def test_mounting_turns_the_heading(heading: int, offset_deg: float) -> None:
    reading = await (await Bench(heading, heading_offset_deg=offset_deg).opened()).read()
    assert 0.0 <= reading.heading_deg < 360.0
    assert wrap180(reading.heading_deg - heading / 10 - offset_deg) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("mounting", "tilt_deg"),
    [
        ({}, (-12.3, 4.5)),
        ({"firmware": 4}, (-12.0, 4.5)),  # which knows pitch in whole degrees only
        ({"reverse_pitch": True}, (12.3, 4.5)),
        ({"reverse_roll": True}, (-12.3, -4.5)),
        ({"swap_pitch_roll": True}, (4.5, -12.3)),
        ({"swap_pitch_roll": True, "reverse_pitch": True}, (-4.5, -12.3)),
        ({"swap_pitch_roll": True, "reverse_roll": True}, (4.5, 12.3)),
    ],
)
@virtual
async def test_mounting_turns_the_tilt(mounting: dict[str, int], tilt_deg: tuple[float, float]) -> None:
    reading = await (await Bench(**mounting).opened()).read()
    assert (reading.pitch_deg, reading.roll_deg) == tilt_deg


@pytest.mark.parametrize(
    ("levels", "told"),
    [(0b11_00_11_11, 3), (0b11_00_00_10, 2), (0b01_00_11_01, 1), (0b00_11_11_11, 0), (0b11_11_11_00, 0)],
)
@virtual
async def test_calibration_is_the_magnetometers_once_the_system_has_any(levels: int, told: int) -> None:
    bench = Bench()
    bench.chip.calibration = levels
    compass = await bench.opened()
    assert (await compass.read()).calibration == told
    assert await compass.calibration() == (levels >> 6, levels >> 4 & 3, levels >> 2 & 3, levels & 3)


@pytest.mark.parametrize("trouble", [nack, swapped_bearing, bit_shifted, lambda _: bytes(31), lambda _: b"\xff" * 31])
@virtual
async def test_one_lost_or_corrupt_block_is_asked_for_again(trouble: Trouble) -> None:
    bench = Bench()
    compass = await bench.opened()
    bench.bus.troubles = (trouble,)
    assert (await compass.read())[1:] == (273.4, -12.3, 4.5, 3)
    await compass.read()
    assert (compass.error_counts, len(bench.sense.asked_s)) == ({"reads retried": 1}, 4)


@pytest.mark.parametrize(
    ("troubles", "error", "text"),
    [
        ((nack, nack), NotResponding, "no acknowledgement"),
        ((swapped_bearing, nack), NotResponding, "no acknowledgement"),
        ((nack, swapped_bearing), BadReading, "CMPS14 firmware 7 at 0x60 on /dev/i2c-1: bearing .* beyond 359.9"),
        ((like_cmps12, like_cmps12), BadReading, "pitch is 437.4 in 16 bits and -12 in 8"),
        ((bit_shifted, bit_shifted), BadReading, "firmware reads 15 and was 7"),
    ],
)
@virtual
async def test_two_failures_in_a_row_are_an_error(
    troubles: tuple[Trouble, ...], error: type[Exception], text: str
) -> None:
    bench = Bench()
    compass = await bench.opened()
    bench.bus.troubles = troubles * 2
    for _ in range(2):
        with pytest.raises(error, match=text):
            await compass.read()
    assert (await compass.read())[:2] == (OPEN_S, 273.4)


@virtual
async def test_part_that_lost_power_is_not_read_as_north() -> None:
    bench = Bench(boot_s=0.5)
    compass = await bench.opened()
    bench.chip.power_cycle()
    with pytest.raises(BadReading, match="no gravity"):
        await compass.read()
    await asyncio.sleep(0.5)
    assert (await compass.read()).heading_deg == 273.4


# -- calibration -------------------------------------------------------------------------------------------------


@virtual
async def test_commands_are_taken_one_right_after_another() -> None:
    bench = Bench()
    compass = await bench.opened()
    await compass.erase_profile()
    assert (bench.chip.calibration, bench.chip.profile) == (0, 0)
    await compass.configure(0x83)
    assert bench.chip.config == 0x83
    bench.chip.calibration = 0xCF
    await compass.store_profile()
    await compass.configure(0x80)
    assert (bench.chip.profile, bench.chip.config, bench.chip.ignored) == (0xCF, 0x80, [])


@pytest.mark.parametrize("cut_after", [0, 1, 2, 3])
@virtual
async def test_configuration_that_was_cut_short_is_not_taken_for_the_argument_of_the_next(cut_after: int) -> None:
    bench = Bench()
    compass = await bench.opened()
    bench.bus.writes_left = cut_after
    with pytest.raises(NotResponding):
        await compass.configure(0x91)
    await compass.configure(0x83)
    assert bench.chip.config == 0x83
    await compass.configure(0x80)
    assert (bench.chip.config, bench.chip.ignored) == (0x80, [])
