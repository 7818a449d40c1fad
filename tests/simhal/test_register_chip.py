"""A chip that is made of registers: what is declared works, anything else fails loudly."""

from __future__ import annotations

import pytest

from wayfarer.testing import ChipMisuse, FakeBuses, RegisterChip


def made(**hooks: object) -> RegisterChip:
    return RegisterChip("XC9", {0x0F: 0x9C, 0x10: 1, 0x11: 2, 0x20: 3}, read_only={0x0F}, **hooks)  # type: ignore[arg-type]


async def test_registers_are_read_and_written_one_after_another() -> None:
    buses, chip = FakeBuses(), made()
    bus = buses.i2c("/dev/i2c-1")
    bus.attach(0x1E, chip)
    assert await bus.write_read(0x1E, b"\x0f", 3) == b"\x9c\x01\x02"
    await bus.write(0x1E, b"\x10\x07\x08")
    assert await bus.write_read(0x1E, b"\x10", 1) == b"\x07"
    assert chip.read(1) == b"\x08", "a read goes on where the last one ended"
    assert chip.registers == {0x0F: 0x9C, 0x10: 7, 0x11: 8, 0x20: 3}
    chip.power_cycle()
    assert chip.registers[0x10] == 1


def test_hooks_bring_in_what_is_measured_and_see_what_is_written() -> None:
    told: list[tuple[int, int]] = []
    wanted: list[range] = []
    chip = made(before_read=wanted.append, written=lambda *what: told.append(what))
    chip.write(b"\x10\x05\x06")
    chip.write(b"\x0f")
    chip.put(0x0F, b"\x2a")
    assert chip.read(2) == b"\x2a\x05", "a read-only register is the chip's own"
    assert (told, wanted) == ([(0x10, 5), (0x11, 6)], [range(0x0F, 0x11)])


@pytest.mark.parametrize(
    ("data", "count", "says"),
    [
        (b"", 0, "XC9: a write without a register"),
        (b"\x12", 0, "XC9: no register 0x12"),
        (b"\x0f\x00", 0, "XC9: register 0x0F cannot be written"),
        (b"\x11\x00\x00", 0, "XC9: no register 0x12"),
        (b"\x11", 2, "XC9: no register 0x12"),
    ],
)
def test_what_is_not_declared_is_misuse(data: bytes, count: int, says: str) -> None:
    chip = made()
    with pytest.raises(ChipMisuse, match=says):
        chip.write(data)
        chip.read(count)
