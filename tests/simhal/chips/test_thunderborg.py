"""The ThunderBorg chip keeps its protocol; ``test_motor_boards.py`` has its deadman.

What another library reads of motors and battery is in ``test_thunderborg_tborg.py``.
"""

from __future__ import annotations

import pytest

from tests.simhal.chips.bench import BoardBench
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.motor_boards import THUNDERBORG_FULL_LEVEL, ThunderBorgChip


class Bench(BoardBench[ThunderBorgChip]):
    def __init__(self) -> None:
        super().__init__(ThunderBorgChip)

    def send(self, written: str) -> None:
        self.chip.write(bytes.fromhex(written))

    def ask(self, written: str, count: int) -> str:
        """Return the echo and so many bytes of the answer."""
        self.send(written)
        return self.chip.read(6)[: count + 1].hex(" ")


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_read_gives_six_bytes_again_and_again_until_something_else_is_written(bench: Bench) -> None:
    bench.send("99")
    assert bench.chip.read(6) == bench.chip.read(6) == bytes.fromhex("99 15 ff ff ff ff")
    with pytest.raises(ChipMisuse, match="6"):
        bench.chip.read(2)
    bench.send("0E 00")
    with pytest.raises(ChipMisuse, match="follows a request"):
        bench.chip.read(6)


@pytest.mark.parametrize("written", ["", "00", "19", "08", "08 01 02", "0A 00", "05 01 02", "FF", "0E"])
def test_what_the_board_does_not_know_is_a_mistake(bench: Bench, written: str) -> None:
    with pytest.raises(ChipMisuse, match="no command"):
        bench.send(written)


def test_motor_b_is_the_left_one_and_95_percent_are_full_duty(bench: Bench) -> None:
    bench.send("0B 79")
    bench.send("09 F2")
    assert bench.world.commanded == (121 / THUNDERBORG_FULL_LEVEL, -242 / THUNDERBORG_FULL_LEVEL)


def test_wires_may_be_swapped_and_reversed() -> None:
    bench = Bench()
    chip = ThunderBorgChip(bench.world, lambda: 0.0, full_level=255.0, left="A", reverse_right=True)
    chip.write(b"\x08\xff")
    chip.write(b"\x0b\x33")
    assert bench.world.commanded == (1.0, -0.2)


def test_leds_take_colours_only_while_they_do_not_show_the_battery(bench: Bench) -> None:
    assert bench.ask("07", 1) == "07 01"
    bench.send("05 01 02 03")
    assert bench.ask("02", 3) == "02 00 00 00"
    bench.send("06 00")
    bench.send("01 01 02 03")
    bench.send("03 04 05 06")
    assert (bench.ask("02", 3), bench.ask("04", 3), bench.ask("07", 1)) == ("02 01 02 03", "04 04 05 06", "07 00")
    bench.send("05 FF 00 FF")
    assert (bench.ask("02", 3), bench.ask("04", 3)) == ("02 ff 00 ff", "04 ff 00 ff")


def test_drive_faults_are_up_until_both_motors_have_been_driven(bench: Bench) -> None:
    assert (bench.ask("0F", 1), bench.ask("10", 1)) == ("0f 01", "10 01")
    bench.send("08 20")
    assert bench.ask("0F", 1) == "0f 01"
    bench.send("0C 20")
    assert (bench.ask("0F", 1), bench.ask("10", 1)) == ("0f 00", "10 00")
    bench.chip.drive_faults.add(1)
    assert (bench.ask("0F", 1), bench.ask("10", 1)) == ("0f 00", "10 01")


def test_losing_power_forgets_all_but_the_eeprom(bench: Bench) -> None:
    for written in ("13 01", "06 00", "05 01 02 03", "16 40 60", "AA 2A", "11 20"):
        bench.send(written)
    bench.chip.power_cycle()
    assert bench.world.commanded == (0.0, 0.0)
    assert [bench.ask(get, 2) for get in ("0A", "0D", "17")] == ["0a 01 00", "0d 01 00", "17 40 60"]
    assert [bench.ask(get, 1) for get in ("14", "07", "0F", "99")] == ["14 00", "07 01", "0f 01", "99 15"]
    assert bench.ask("02", 3) == "02 00 00 00"
    assert bench.chip.address == 0x2A


# -- failsafe --------------------------------------------------------------------------------------------------------


def test_requests_and_colours_do_not_keep_the_failsafe_from_tripping(bench: Bench) -> None:
    bench.send("13 01")
    bench.send("11 79")
    for bench.now_s in (0.1, 0.2, 0.3):
        for written in ("15", "14", "13 01", "06 00"):
            bench.send(written)
    assert bench.world.commanded == (0.0, 0.0)


def test_a_failsafe_switched_on_late_gives_its_whole_interval(bench: Bench) -> None:
    bench.send("11 79")
    bench.now_s = 5.0
    bench.send("13 01")
    bench.now_s = 5.2
    bench.chip.tick()
    assert bench.chip.levels == (0x79, 0x79)
    bench.now_s = 5.26
    bench.chip.tick()
    assert bench.chip.levels == (0, 0)
