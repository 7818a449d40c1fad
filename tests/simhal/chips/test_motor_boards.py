"""The motor boards' chips keep their protocols, and their deadmen stop the wheels however late that is noticed.

What other people's libraries make of them is in ``test_thunderborg_tborg.py`` and ``test_sabertooth_pysabertooth.py``.
"""

from __future__ import annotations

from functools import partial
from itertools import accumulate, pairwise
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.chips.bench import BoardBench
from tests.simhal.clearing import steady_world
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.motor_boards import THUNDERBORG_FULL_LEVEL, SabertoothChip, ThunderBorgChip

# -- deadmen -----------------------------------------------------------------------------------------------------------

STILL = (0.0, 0.0)


class Board(NamedTuple):
    """How a board is told to arm and disarm its deadman and to go ahead (at ``duty``), and bytes that do nothing."""

    chip: type[ThunderBorgChip | SabertoothChip]
    arm: str
    disarm: str
    ahead: str
    idle: str
    duty: float
    deadman_s: float


BOARDS = {
    "ThunderBorg": Board(ThunderBorgChip, "13 01", "13 00", "11 F2", "15", 242 / THUNDERBORG_FULL_LEVEL, 0.25),
    "Sabertooth": Board(SabertoothChip, "80 0E 03 11", "80 0E 00 0E", "80 00 7F 7F 80 04 7F 03", "80", 1.0, 0.3),
}
each_board = pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)


class Bench(BoardBench[ThunderBorgChip | SabertoothChip]):
    def __init__(self, board: Board) -> None:
        super().__init__(board.chip)

    def send(self, sent: str) -> None:
        data = bytes.fromhex(sent)
        if isinstance(self.chip, ThunderBorgChip):
            self.chip.write(data)
        else:
            self.chip.receive(data)


@each_board
def test_without_the_deadman_the_wheels_turn_on(board: Board) -> None:
    bench = Bench(board)
    for before in ((), (board.arm, board.disarm)):
        for sent in (*before, board.ahead):
            bench.send(sent)
        bench.now_s += 60.0
        bench.chip.tick()
        assert bench.world.commanded == (board.duty, board.duty)


@each_board
def test_deadman_stops_the_wheels_at_its_own_time_however_late_that_is_noticed(board: Board) -> None:
    bench, other = Bench(board), steady_world()
    bench.send(board.arm)
    bench.now_s = 1.0
    bench.send(board.ahead)
    bench.now_s = 10.0
    bench.send(board.idle)
    for t_s, duty in ((1.0, board.duty), (1.0 + board.deadman_s, 0.0)):
        other.advance_to(t_s)
        other.command(duty, duty)
    for world in (bench.world, other):
        world.advance_to(10.0)
    assert 0.3 < bench.world.path_m == other.path_m < 0.6
    assert bench.chip.levels == (0, 0)


@each_board
@given(gaps_s=st.lists(st.floats(0.0, 0.5), min_size=1, max_size=20), look_s=st.floats(0.0, 0.5))
def test_wheels_turn_exactly_while_the_last_command_is_young(board: Board, gaps_s: list[float], look_s: float) -> None:
    bench = Bench(board)
    bench.send(board.arm)
    for bench.now_s in accumulate(gaps_s):
        bench.send(board.ahead)
        assert bench.world.commanded == (board.duty, board.duty)
    stops_s = bench.chip.stops_by_s
    assert stops_s == pytest.approx(bench.now_s + board.deadman_s)
    bench.now_s += look_s
    bench.chip.tick()
    assert (bench.world.commanded != STILL) == (bench.now_s < stops_s)


# -- Sabertooth --------------------------------------------------------------------------------------------------------

BOTH_AHEAD = "80 00 7F 7F 80 04 7F 03"


class SabertoothBench(BoardBench[SabertoothChip]):
    def __init__(self, address: int = 128) -> None:
        super().__init__(partial(SabertoothChip, address=address))

    def send(self, sent: str) -> None:
        self.chip.receive(bytes.fromhex(sent))


@pytest.fixture
def sabertooth() -> SabertoothBench:
    return SabertoothBench()


# -- packets ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sent", "m1", "m2"),
    [
        ("80 00 7F 7F", 127, 0),
        ("80 01 7F 00", -127, 0),
        ("80 04 40 44", 0, 64),
        ("80 05 40 45", 0, -64),
        (f"{BOTH_AHEAD} 80 00 00 00 80 04 00 04", 0, 0),
    ],
)
def test_motors_turn_as_told(sabertooth: SabertoothBench, sent: str, m1: int, m2: int) -> None:
    sabertooth.send(sent)
    assert sabertooth.chip.levels == (m1, m2)
    assert sabertooth.world.commanded == (m1 / 127, m2 / 127)
    assert sabertooth.chip.dropped == 0


@pytest.mark.parametrize(("address", "sent"), [(130, "82 00 40 42"), (135, "87 00 40 47")])
def test_a_packet_for_another_address_is_passed_over(address: int, sent: str) -> None:
    mine, other = SabertoothBench(address), SabertoothBench()
    mine.send(sent)
    other.send(sent)
    assert (mine.chip.levels, other.chip.levels) == ((64, 0), (0, 0))
    assert other.chip.dropped == 0


def test_wires_of_a_sabertooth_may_be_swapped_and_reversed(sabertooth: SabertoothBench) -> None:
    chip = SabertoothChip(sabertooth.world, lambda: 0.0, full_level=63.5, left=2, reverse_right=True)
    chip.receive(bytes.fromhex("80 00 20 20 80 04 40 44"))
    assert sabertooth.world.commanded == (64 / 63.5, -32 / 63.5)


@given(cuts=st.sets(st.integers(0, 8)))
def test_packets_may_come_in_any_pieces(cuts: set[int]) -> None:
    sabertooth, data = SabertoothBench(), bytes.fromhex(BOTH_AHEAD)
    for start, end in pairwise(sorted({0, *cuts, len(data)})):
        sabertooth.chip.receive(data[start:end])
    assert sabertooth.chip.levels == (127, 127)


@given(at=st.integers(0, 3), value=st.integers(0, 255))
def test_a_packet_with_one_wrong_byte_does_not_move_the_wheels(at: int, value: int) -> None:
    sabertooth, data = SabertoothBench(), bytearray.fromhex("80 00 40 40")
    changed = value != data[at]
    data[at] = value
    sabertooth.chip.receive(bytes(data))
    assert (sabertooth.chip.levels == (0, 0)) == changed


@pytest.mark.parametrize(
    ("noise", "dropped"),
    [("80", 1), ("80 00", 1), ("80 00 7F", 1), ("80 00 7F 7E", 1), ("00 7F 7F", 0), ("AA AA", 0), ("80 AA", 1)],
)
def test_after_noise_the_next_packet_is_taken(sabertooth: SabertoothBench, noise: str, dropped: int) -> None:
    sabertooth.send(noise)
    sabertooth.send("80 04 40 44")
    assert (sabertooth.chip.levels, sabertooth.chip.dropped) == ((0, 64), dropped)


@pytest.mark.parametrize("sent", ["80 12 00 12", "80 02 79 7B", "80 0F 05 14", "80 08 40 48"])
def test_what_a_sabertooth_does_not_know_is_a_mistake(sabertooth: SabertoothBench, sent: str) -> None:
    with pytest.raises(ChipMisuse, match="command"):
        sabertooth.send(sent)


# -- settings and power ----------------------------------------------------------------------------------------------


def test_settings_are_kept_and_the_baud_rate_outlives_the_power(sabertooth: SabertoothBench) -> None:
    sabertooth.send("80 0E 05 13 80 02 14 16 80 0F 04 13")
    assert sabertooth.chip.settings == {14: 5, 2: 20, 15: 4}
    sabertooth.send(BOTH_AHEAD)
    sabertooth.send("80 00")
    sabertooth.chip.power_cycle()
    assert sabertooth.chip.settings == {15: 4}
    assert sabertooth.world.commanded == STILL
    sabertooth.send("7F 7F")
    assert sabertooth.world.commanded == STILL


# -- serial timeout --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stop", ["80 0E 03 11", None], ids=["timeout", "power"])
def test_one_side_that_is_told_again_after_a_stop_does_not_turn_the_other(
    sabertooth: SabertoothBench, stop: str | None
) -> None:
    sabertooth.send(f"{stop or ''} {BOTH_AHEAD}")
    if stop is None:
        sabertooth.chip.power_cycle()
    sabertooth.now_s = 1.0
    sabertooth.send("80 00 40 40")
    assert sabertooth.chip.levels == (64, 0)


def test_a_dropped_packet_does_not_keep_the_timeout_from_tripping(sabertooth: SabertoothBench) -> None:
    sabertooth.send(f"80 0E 03 11 {BOTH_AHEAD}")
    sabertooth.now_s = 0.2
    sabertooth.send("80 00 7F 00")
    sabertooth.now_s = 0.31
    sabertooth.chip.tick()
    assert sabertooth.world.commanded == STILL


# -- a board that takes the line's speed from the first byte ---------------------------------------------------------


def old_board() -> BoardBench[SabertoothChip]:
    return BoardBench(partial(SabertoothChip, autobaud=True))


@pytest.mark.parametrize(
    ("first", "at_s", "hears"),
    [
        ("AA", 2.0, True),
        (f"AA {BOTH_AHEAD}", 2.0, True),
        ("AA", 1.9, False),  # it is starting
        (BOTH_AHEAD, 2.0, False),
        ("00 AA", 2.0, False),
        ("82 00 40 42", 2.0, False),  # for another board on the line
    ],
)
def test_old_board_takes_commands_only_if_the_first_byte_after_its_start_was_aa(
    first: str, at_s: float, hears: bool
) -> None:
    sabertooth = old_board()
    sabertooth.now_s = at_s
    sabertooth.chip.receive(bytes.fromhex(first))
    sabertooth.now_s = 3.0
    sabertooth.chip.receive(bytes.fromhex(BOTH_AHEAD))
    assert sabertooth.chip.levels == ((127, 127) if hears else (0, 0))


def test_old_board_must_hear_it_again_when_its_power_was_off() -> None:
    sabertooth = old_board()
    sabertooth.now_s = 2.0
    sabertooth.chip.receive(bytes.fromhex(f"AA {BOTH_AHEAD}"))
    sabertooth.chip.power_cycle()
    assert sabertooth.chip.levels == (0, 0)
    for sabertooth.now_s, sent, level in ((3.0, f"AA {BOTH_AHEAD}", 0), (4.0, f"AA {BOTH_AHEAD}", 127)):
        sabertooth.chip.receive(bytes.fromhex(sent))
        assert sabertooth.chip.levels == (level, level)


# -- ThunderBorg -------------------------------------------------------------------------------------------------------


class ThunderBorgBench(BoardBench[ThunderBorgChip]):
    def __init__(self) -> None:
        super().__init__(ThunderBorgChip)

    def send(self, written: str) -> None:
        self.chip.write(bytes.fromhex(written))

    def ask(self, written: str, count: int) -> str:
        """Return the echo and so many bytes of the answer."""
        self.send(written)
        return self.chip.read(6)[: count + 1].hex(" ")


@pytest.fixture
def thunderborg() -> ThunderBorgBench:
    return ThunderBorgBench()


def test_a_read_gives_six_bytes_again_and_again_until_something_else_is_written(thunderborg: ThunderBorgBench) -> None:
    thunderborg.send("99")
    assert thunderborg.chip.read(6) == thunderborg.chip.read(6) == bytes.fromhex("99 15 ff ff ff ff")
    with pytest.raises(ChipMisuse, match="6"):
        thunderborg.chip.read(2)
    thunderborg.send("0E 00")
    with pytest.raises(ChipMisuse, match="follows a request"):
        thunderborg.chip.read(6)


@pytest.mark.parametrize("written", ["", "00", "19", "08", "08 01 02", "0A 00", "05 01 02", "FF", "0E"])
def test_what_a_thunderborg_does_not_know_is_a_mistake(thunderborg: ThunderBorgBench, written: str) -> None:
    with pytest.raises(ChipMisuse, match="no command"):
        thunderborg.send(written)


def test_motor_b_is_the_left_one_and_95_percent_are_full_duty(thunderborg: ThunderBorgBench) -> None:
    thunderborg.send("0B 79")
    thunderborg.send("09 F2")
    assert thunderborg.world.commanded == (121 / THUNDERBORG_FULL_LEVEL, -242 / THUNDERBORG_FULL_LEVEL)


def test_wires_of_a_thunderborg_may_be_swapped_and_reversed() -> None:
    thunderborg = ThunderBorgBench()
    chip = ThunderBorgChip(thunderborg.world, lambda: 0.0, full_level=255.0, left="A", reverse_right=True)
    chip.write(b"\x08\xff")
    chip.write(b"\x0b\x33")
    assert thunderborg.world.commanded == (1.0, -0.2)


def test_leds_take_colours_only_while_they_do_not_show_the_battery(thunderborg: ThunderBorgBench) -> None:
    assert thunderborg.ask("07", 1) == "07 01"
    thunderborg.send("05 01 02 03")
    assert thunderborg.ask("02", 3) == "02 00 00 00"
    thunderborg.send("06 00")
    thunderborg.send("01 01 02 03")
    thunderborg.send("03 04 05 06")
    assert (thunderborg.ask("02", 3), thunderborg.ask("04", 3), thunderborg.ask("07", 1)) == (
        "02 01 02 03",
        "04 04 05 06",
        "07 00",
    )
    thunderborg.send("05 FF 00 FF")
    assert (thunderborg.ask("02", 3), thunderborg.ask("04", 3)) == ("02 ff 00 ff", "04 ff 00 ff")


def test_drive_faults_are_up_until_both_motors_have_been_driven(thunderborg: ThunderBorgBench) -> None:
    assert (thunderborg.ask("0F", 1), thunderborg.ask("10", 1)) == ("0f 01", "10 01")
    thunderborg.send("08 20")
    assert thunderborg.ask("0F", 1) == "0f 01"
    thunderborg.send("0C 20")
    assert (thunderborg.ask("0F", 1), thunderborg.ask("10", 1)) == ("0f 00", "10 00")
    thunderborg.chip.drive_faults.add(1)
    assert (thunderborg.ask("0F", 1), thunderborg.ask("10", 1)) == ("0f 00", "10 01")


def test_losing_power_forgets_all_but_the_eeprom(thunderborg: ThunderBorgBench) -> None:
    for written in ("13 01", "06 00", "05 01 02 03", "16 40 60", "AA 2A", "11 20"):
        thunderborg.send(written)
    thunderborg.chip.power_cycle()
    assert thunderborg.world.commanded == (0.0, 0.0)
    assert [thunderborg.ask(get, 2) for get in ("0A", "0D", "17")] == ["0a 01 00", "0d 01 00", "17 40 60"]
    assert [thunderborg.ask(get, 1) for get in ("14", "07", "0F", "99")] == ["14 00", "07 01", "0f 01", "99 15"]
    assert thunderborg.ask("02", 3) == "02 00 00 00"
    assert thunderborg.chip.address == 0x2A


# -- failsafe --------------------------------------------------------------------------------------------------------


def test_requests_and_colours_do_not_keep_the_failsafe_from_tripping(thunderborg: ThunderBorgBench) -> None:
    thunderborg.send("13 01")
    thunderborg.send("11 79")
    for thunderborg.now_s in (0.1, 0.2, 0.3):
        for written in ("15", "14", "13 01", "06 00"):
            thunderborg.send(written)
    assert thunderborg.world.commanded == (0.0, 0.0)


def test_a_failsafe_switched_on_late_gives_its_whole_interval(thunderborg: ThunderBorgBench) -> None:
    thunderborg.send("11 79")
    thunderborg.now_s = 5.0
    thunderborg.send("13 01")
    thunderborg.now_s = 5.2
    thunderborg.chip.tick()
    assert thunderborg.chip.levels == (0x79, 0x79)
    thunderborg.now_s = 5.26
    thunderborg.chip.tick()
    assert thunderborg.chip.levels == (0, 0)
