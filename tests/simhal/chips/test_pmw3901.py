"""The simulated PMW3901 answers as its registers are documented, and refuses what they are not."""

from __future__ import annotations

from struct import unpack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.chips.bench import Clock, Driven
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.pmw3901 import PMW3901Chip, orient

counts = st.integers(-1000, 1000)


def write(chip: PMW3901Chip, register: int, value: int) -> None:
    assert len(chip.exchange(bytes((register | 0x80, value)))) == 2


def read(chip: PMW3901Chip, register: int) -> int:
    return chip.exchange(bytes((register, 0)))[1]


def burst(chip: PMW3901Chip) -> bytes:
    answer = chip.exchange(b"\x16" + bytes(12))
    assert len(answer) == 13
    return answer[1:]


def started(*displacements: tuple[int, int]) -> tuple[PMW3901Chip, Driven, Clock]:
    sense, clock = Driven(*displacements), Clock()
    chip = PMW3901Chip(sense, clock)
    start(chip, clock)
    return chip, sense, clock


def start(chip: PMW3901Chip, clock: Clock) -> None:
    """Do as little as makes the chip run."""
    write(chip, 0x3A, 0x5A)
    clock.t_s += 0.02
    for register in range(0x02, 0x07):
        read(chip, register)
    write(chip, 0x40, 0x80)


def test_identity_is_in_bank_00_only() -> None:
    chip = PMW3901Chip(Driven(), Clock())
    assert (read(chip, 0x00), read(chip, 0x5F)) == (0x49, 0xB6)
    write(chip, 0x7F, 0x05)
    write(chip, 0x5F, 0x34)
    assert read(chip, 0x5F) == 0x34
    with pytest.raises(ChipMisuse, match="0x00 in bank 0x05"):
        read(chip, 0x00)
    write(chip, 0x7F, 0x00)
    assert read(chip, 0x5F) == 0xB6


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"\x3b\x00", "no such register 0x3B"),  # shutdown
        (b"\xd8\xff", "no such register 0x58"),  # frame grab
        (b"\x80\x49", "not to be written"),  # the product id
        (b"\xff\x02", "no bank 0x02"),
        (b"\x00", "1 bytes"),
        (b"\x00\x00\x00", "3 bytes"),
        (b"\x16\x00", "2 bytes"),
        (b"", "0 bytes"),
    ],
)
def test_what_the_chip_does_not_know_fails(data: bytes, match: str) -> None:
    with pytest.raises(ChipMisuse, match=match):
        PMW3901Chip(Driven(), Clock()).exchange(data)


def test_burst_and_reset_are_not_in_other_banks() -> None:
    chip, _, _ = started()
    write(chip, 0x7F, 0x0E)
    for data in (b"\x16" + bytes(12), b"\xba\x5a"):
        with pytest.raises(ChipMisuse, match="in bank 0x0E"):
            chip.exchange(data)


def test_reset_takes_a_millisecond_and_forgets_the_settings() -> None:
    chip, _, clock = started()
    write(chip, 0x5B, 0x20)
    assert read(chip, 0x5B) == 0x20
    write(chip, 0x3A, 0x5A)
    clock.t_s += 0.0005
    with pytest.raises(ChipMisuse, match="within 1 ms of its reset"):
        read(chip, 0x00)
    clock.t_s += 0.0006
    assert read(chip, 0x5B) == 0xA0


def test_nothing_is_felt_until_the_start_up_is_complete() -> None:
    sense, clock = Driven((5, 0)), Clock()
    chip = PMW3901Chip(sense, clock)
    assert burst(chip)[:6] == bytes.fromhex("30 00 00 00 00 00")
    start(chip, clock)
    assert sense.asked_s == []
    assert burst(chip)[:6] == bytes.fromhex("B0 BF 00 00 FB FF")
    assert sense.asked_s == [clock.t_s]


def test_chip_does_not_run_where_its_motion_registers_were_not_read_after_the_reset() -> None:
    sense, clock = Driven((5, 0)), Clock()
    chip = PMW3901Chip(sense, clock)
    for register in (0x02, 0x03, 0x04, 0x05):  # 06 is missing
        read(chip, register)
    write(chip, 0x40, 0x80)
    assert burst(chip)[:2] == b"\x30\x00"
    assert sense.asked_s == []


def test_vector_of_a_normal_burst() -> None:
    chip, _, _ = started((5, 5), (0, 0))
    assert burst(chip) == bytes.fromhex("B0 BF 05 00 FB FF 4C 55 A0 1E 02 58")
    assert burst(chip) == bytes.fromhex("30 BF 00 00 00 00 4C 55 A0 1E 02 58")


def test_reading_the_motion_register_latches_the_counts_and_begins_again_at_0() -> None:
    chip, sense, _ = started((300, -2), (7, 0))
    registers = bytes(read(chip, register) for register in range(0x02, 0x07))
    assert unpack("<Bhh", registers) == (0xB0, -2, -300)
    assert bytes(read(chip, register) for register in range(0x03, 0x07)) == registers[1:]
    assert len(sense.asked_s) == 1
    assert unpack("<hh", burst(chip)[2:6]) == (0, -7)
    assert len(sense.asked_s) == 2


def test_shutter_is_lower_then_upper_in_registers_and_the_reverse_in_a_burst() -> None:
    chip, _, _ = started()
    chip.squal, chip.shutter = 18, 0x1F40
    assert [read(chip, register) for register in range(0x07, 0x0D)] == [18, 0x55, 0xA0, 0x1E, 0x40, 0x1F]
    assert burst(chip)[6:] == bytes.fromhex("12 55 A0 1E 1F 40")


def test_observation_byte_comes_back_after_two_frames_if_the_chip_runs() -> None:
    chip, _, clock = started()
    assert read(chip, 0x15) == 0xBF
    write(chip, 0x15, 0x00)
    clock.t_s += 0.014
    assert read(chip, 0x15) == burst(chip)[1] == 0x00
    clock.t_s += 0.002
    assert read(chip, 0x15) == burst(chip)[1] == 0xBF
    write(chip, 0x7F, 0x0E)
    chip.power_cycle()
    assert read(chip, 0x15) == 0x00, "in bank 00 again, and not running"


def test_probe_is_confirmed_after_as_many_writes_as_it_takes() -> None:
    chip = PMW3901Chip(Driven(), Clock(), probes_needed=2)
    write(chip, 0x7F, 0x0E)
    seen = []
    for _ in range(3):
        write(chip, 0x43, 0x10)
        seen.append(read(chip, 0x47))
    assert seen == [0x00, 0x08, 0x08]


def test_motion_over_too_little_texture_is_lost_not_deferred() -> None:
    chip, sense, _ = started((50, 0), (3, 0))
    chip.squal = 0x18
    assert burst(chip)[:6] == bytes.fromhex("30 BF 00 00 00 00")
    chip.squal = 76
    assert unpack("<hh", burst(chip)[2:6]) == (0, -3)
    assert len(sense.asked_s) == 2


def test_counts_end_at_16_bits() -> None:
    chip, _, _ = started((40_000, -40_000))
    assert unpack("<hh", burst(chip)[2:6]) == (-32_768, -32_768)


def test_orientation_register_turns_the_counts_of_the_next_burst() -> None:
    chip, _, _ = started((5, 2), (5, 2))
    assert unpack("<hh", burst(chip)[2:6]) == (2, -5)
    write(chip, 0x5B, 0xE0)
    assert unpack("<hh", burst(chip)[2:6]) == (2, 5)


@given(x=counts, y=counts)
def test_orientations_of_pimoroni_are_quarter_turns_of_one_another(x: int, y: int) -> None:
    assert orient(0xA0, x, y) == (x, y), "which the start-up leaves there"
    turned = orient(0xE0, x, y)
    for register in (0x40, 0x80, 0x20):
        turned = -turned[1], turned[0]
        assert orient(register, x, y) == turned


@given(register=st.integers(0, 255), x=counts, y=counts)
def test_orientation_keeps_the_distance(register: int, x: int, y: int) -> None:
    assert sorted(map(abs, orient(register, x, y))) == sorted((abs(x), abs(y)))
