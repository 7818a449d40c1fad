"""The simulated CMPS14 answers as its data sheet says, and refuses what it does not know."""

from __future__ import annotations

from math import hypot
from struct import unpack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.chips.bench import Clock, Held
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.cmps14 import CALIBRATED, CMPS14Chip

CONFIGURE = (0x98, 0x95, 0x99)
STORE = (0xF0, 0xF5, 0xF6)
ERASE = (0xE0, 0xE5, 0xE2)
CHANGE_ADDRESS = (0xA0, 0xAA, 0xA5)


def registers(chip: CMPS14Chip, start: int, count: int) -> bytes:
    chip.write(bytes((start,)))
    return chip.read(count)


def send(chip: CMPS14Chip, clock: Clock, *sequence: int, gap_s: float = 0.02) -> None:
    for byte in sequence:
        chip.write(bytes((0x00, byte)))
        clock.t_s += gap_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def chip(clock: Clock) -> CMPS14Chip:
    return CMPS14Chip(Held(2734, -123, 45), clock)


# -- registers ---------------------------------------------------------------------------------------------------


def test_registers_are_those_of_the_data_sheet(chip: CMPS14Chip) -> None:
    block = registers(chip, 0x00, 31)
    assert block[:6].hex(" ") == "07 c2 0a ae f4 04"
    assert block[0x18:].hex(" ") == "00 00 ff 85 00 2d cf"


@pytest.mark.parametrize(("heading", "step"), [(0, 0), (7, 0), (8, 1), (1800, 128), (3592, 255), (3593, 0), (3599, 0)])
def test_bearing_in_eight_bits_is_the_nearest_step_of_the_turn(heading: int, step: int, clock: Clock) -> None:
    block = registers(CMPS14Chip(Held(heading), clock), 0x01, 3)
    assert unpack(">BH", block) == (step, heading)


@given(st.integers(0, 3599), st.integers(-900, 900), st.integers(-1800, 1800))
def test_accelerometer_feels_one_g_in_every_attitude(heading: int, pitch: int, roll: int) -> None:
    block = registers(CMPS14Chip(Held(heading, pitch, roll), Clock()), 0x0C, 6)
    assert hypot(*unpack(">3h", block)) == pytest.approx(1000, abs=1.5)


@given(st.integers(0, 3599))
def test_magnetometer_turns_with_the_heading(heading: int) -> None:
    north, west, down = unpack(">3h", registers(CMPS14Chip(Held(heading), Clock()), 0x06, 6))
    opposite = unpack(">3h", registers(CMPS14Chip(Held((heading + 1800) % 3600), Clock()), 0x06, 6))
    assert opposite == (-north, -west, down)
    assert hypot(north, west) == pytest.approx(200, abs=1.0)


def test_tilt_beyond_the_part_ends_at_its_ranges(clock: Clock) -> None:
    block = registers(CMPS14Chip(Held(0, 950, -1700), clock), 0x00, 31)
    assert unpack(">bb", block[4:6]) == (90, -90)
    assert registers(CMPS14Chip(Held(3599, 899, -899), clock), 0x04, 2) == b"\x59\xa7", "it is cut off, not rounded"
    assert unpack(">hh", block[0x1A:0x1E]) == (900, -1700)


def test_old_firmware_has_no_pitch_in_sixteen_bits(clock: Clock) -> None:
    block = registers(CMPS14Chip(Held(0, -123, 45), clock, firmware=4), 0x00, 31)
    assert (block[0], block[0x04], block[0x1A:0x1E].hex(" ")) == (4, 0xF4, "00 00 00 2d")


def test_pointer_moves_along_with_the_reads(chip: CMPS14Chip) -> None:
    whole = registers(chip, 0x00, 31)
    chip.write(b"\x02")
    assert chip.read(2) + chip.read(3) == whole[2:7]


# -- sampling ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "count", "samples"),
    [(0x00, 1, 0), (0x1E, 1, 0), (0x00, 2, 1), (0x00, 31, 1), (0x02, 2, 1), (0x1D, 1, 1), (0x1D, 2, 1)],
)
def test_one_sample_for_each_read_of_what_is_measured(start: int, count: int, samples: int, clock: Clock) -> None:
    sense = Held()
    registers(CMPS14Chip(sense, clock), start, count)
    assert sense.asked_s == [clock.t_s] * samples


# -- misuse ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("start", "count"), [(0x00, 32), (0x1E, 2), (0x00, 0)])
def test_reads_beyond_the_map_are_refused(start: int, count: int, chip: CMPS14Chip) -> None:
    chip.write(bytes((start,)))
    with pytest.raises(ChipMisuse, match="registers are 00 to 1e"):
        chip.read(count)


@pytest.mark.parametrize("data", [b"", b"\x1f", b"\xff\x00", b"\x01\x98", b"\x1e\x00", b"\x00\x98\x95"])
def test_writes_that_no_register_takes_are_refused(data: bytes, chip: CMPS14Chip) -> None:
    with pytest.raises(ChipMisuse):
        chip.write(data)


@pytest.mark.parametrize(
    "sequence",
    [
        (0x11,),
        (0xF0, 0x11),
        *((*CONFIGURE, byte) for byte in (0x13, 0x88)),
        *((*CHANGE_ADDRESS, byte) for byte in (0x60, 0xC1, 0xD0)),
    ],
)
def test_bytes_that_belong_to_no_command_are_refused(sequence: tuple[int, ...], chip: CMPS14Chip, clock: Clock) -> None:
    with pytest.raises(ChipMisuse):
        send(chip, clock, *sequence)


# -- commands ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("config", [0x80, 0x83, 0x91, 0x97])
def test_configuration_is_taken(config: int, chip: CMPS14Chip, clock: Clock) -> None:
    send(chip, clock, *CONFIGURE, config)
    assert (chip.config, chip.ignored) == (config, [])


def test_address_changes_for_the_next_power_up(chip: CMPS14Chip, clock: Clock) -> None:
    send(chip, clock, *CHANGE_ADDRESS, 0xC2)
    chip.power_cycle()
    assert chip.address == 0x61


def test_stored_calibration_outlives_a_loss_of_power(chip: CMPS14Chip, clock: Clock) -> None:
    chip.calibration = 0x8A
    send(chip, clock, *CONFIGURE[:2], *STORE)  # a command may begin where another broke off
    send(chip, clock, *CONFIGURE, 0x93)
    chip.calibration = 0x00
    chip.power_cycle()
    assert registers(chip, 0x1E, 1) == b"\x8a"
    assert chip.config == 0x80, "which nothing stores"


def test_erasing_takes_the_calibration_and_time(chip: CMPS14Chip, clock: Clock) -> None:
    send(chip, clock, *ERASE)
    assert registers(chip, 0x1E, 1) == b"\x00"
    send(chip, clock, 0xF0, 0xF5)
    assert chip.ignored == [0xF0, 0xF5]
    clock.t_s += 0.3
    send(chip, clock, *CONFIGURE, 0x83)
    assert chip.config == 0x83


@pytest.mark.parametrize("early", range(1, 4))
def test_a_byte_that_comes_early_breaks_the_command(early: int, chip: CMPS14Chip, clock: Clock) -> None:
    sequence = (*CONFIGURE, 0x93)
    send(chip, clock, *sequence[:early])
    clock.t_s -= 0.001
    send(chip, clock, sequence[early])
    assert (chip.config, chip.ignored) == (0x80, [sequence[early]])
    send(chip, clock, *sequence)
    assert chip.config == 0x93


@given(st.floats(0.0, 1e6))
def test_a_gap_of_twenty_milliseconds_is_enough_at_any_time(t_s: float) -> None:
    clock = Clock()
    clock.t_s = t_s
    chip = CMPS14Chip(Held(), clock)
    send(chip, clock, *CONFIGURE, 0x93)
    assert chip.config == 0x93


@pytest.mark.parametrize("sequence", [(0xF0, 0xF5, 0xE2), (0xF0, 0xF6), (0xF5, 0xF6), (0xF0, 0xF5, 0xF0, 0xF6)])
def test_bytes_out_of_place_break_the_command(sequence: tuple[int, ...], chip: CMPS14Chip, clock: Clock) -> None:
    chip.calibration = 0x8A
    send(chip, clock, *sequence)
    assert chip.profile == CALIBRATED


# -- power -------------------------------------------------------------------------------------------------------


def test_unfinished_commands_and_the_pointer_do_not_outlive_a_loss_of_power(chip: CMPS14Chip, clock: Clock) -> None:
    send(chip, clock, *STORE[:2])
    chip.write(b"\x02")
    chip.power_cycle()
    assert chip.read(1) == b"\x07"
    chip.calibration = 0x8A
    send(chip, clock, STORE[2])
    assert chip.profile == CALIBRATED


def test_all_but_the_firmware_reads_zero_while_it_boots(clock: Clock) -> None:
    chip = CMPS14Chip(Held(2734), clock, boot_s=0.5)
    chip.power_cycle()
    assert registers(chip, 0x00, 31) == b"\x07" + bytes(30)
    clock.t_s += 0.5
    assert registers(chip, 0x02, 2) == b"\x0a\xae"
