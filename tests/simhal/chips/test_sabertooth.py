"""The Sabertooth chip takes whole packets from whatever the line brings; ``test_motor_boards.py`` has its deadman."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.chips.bench import BoardBench
from wayfarer.simhal.buses import ChipMisuse
from wayfarer.simhal.chips.motor_boards import SabertoothChip

STILL = (0.0, 0.0)
BOTH_AHEAD = "80 00 7F 7F 80 04 7F 03"


class Bench(BoardBench[SabertoothChip]):
    def __init__(self, address: int = 128) -> None:
        super().__init__(partial(SabertoothChip, address=address))

    def send(self, sent: str) -> None:
        self.chip.receive(bytes.fromhex(sent))


@pytest.fixture
def bench() -> Bench:
    return Bench()


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
def test_motors_turn_as_told(bench: Bench, sent: str, m1: int, m2: int) -> None:
    bench.send(sent)
    assert bench.chip.levels == (m1, m2)
    assert bench.world.commanded == (m1 / 127, m2 / 127)
    assert bench.chip.dropped == 0


@pytest.mark.parametrize(("address", "sent"), [(130, "82 00 40 42"), (135, "87 00 40 47")])
def test_a_packet_for_another_address_is_passed_over(address: int, sent: str) -> None:
    mine, other = Bench(address), Bench()
    mine.send(sent)
    other.send(sent)
    assert (mine.chip.levels, other.chip.levels) == ((64, 0), (0, 0))
    assert other.chip.dropped == 0


def test_wires_may_be_swapped_and_reversed(bench: Bench) -> None:
    chip = SabertoothChip(bench.world, lambda: 0.0, full_level=63.5, left=2, reverse_right=True)
    chip.receive(bytes.fromhex("80 00 20 20 80 04 40 44"))
    assert bench.world.commanded == (64 / 63.5, -32 / 63.5)


@given(cuts=st.sets(st.integers(0, 8)))
def test_packets_may_come_in_any_pieces(cuts: set[int]) -> None:
    bench, data = Bench(), bytes.fromhex(BOTH_AHEAD)
    for start, end in pairwise(sorted({0, *cuts, len(data)})):
        bench.chip.receive(data[start:end])
    assert bench.chip.levels == (127, 127)


@given(at=st.integers(0, 3), value=st.integers(0, 255))
def test_a_packet_with_one_wrong_byte_does_not_move_the_wheels(at: int, value: int) -> None:
    bench, data = Bench(), bytearray.fromhex("80 00 40 40")
    changed = value != data[at]
    data[at] = value
    bench.chip.receive(bytes(data))
    assert (bench.chip.levels == (0, 0)) == changed


@pytest.mark.parametrize(
    ("noise", "dropped"),
    [("80", 1), ("80 00", 1), ("80 00 7F", 1), ("80 00 7F 7E", 1), ("00 7F 7F", 0), ("AA AA", 0), ("80 AA", 1)],
)
def test_after_noise_the_next_packet_is_taken(bench: Bench, noise: str, dropped: int) -> None:
    bench.send(noise)
    bench.send("80 04 40 44")
    assert (bench.chip.levels, bench.chip.dropped) == ((0, 64), dropped)


@pytest.mark.parametrize("sent", ["80 12 00 12", "80 02 79 7B", "80 0F 05 14", "80 08 40 48"])
def test_what_the_board_does_not_know_is_a_mistake(bench: Bench, sent: str) -> None:
    with pytest.raises(ChipMisuse, match="command"):
        bench.send(sent)


# -- settings and power ----------------------------------------------------------------------------------------------


def test_settings_are_kept_and_the_baud_rate_outlives_the_power(bench: Bench) -> None:
    bench.send("80 0E 05 13 80 02 14 16 80 0F 04 13")
    assert bench.chip.settings == {14: 5, 2: 20, 15: 4}
    bench.send(BOTH_AHEAD)
    bench.send("80 00")
    bench.chip.power_cycle()
    assert bench.chip.settings == {15: 4}
    assert bench.world.commanded == STILL
    bench.send("7F 7F")
    assert bench.world.commanded == STILL


# -- serial timeout --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stop", ["80 0E 03 11", None], ids=["timeout", "power"])
def test_one_side_that_is_told_again_after_a_stop_does_not_turn_the_other(bench: Bench, stop: str | None) -> None:
    bench.send(f"{stop or ''} {BOTH_AHEAD}")
    if stop is None:
        bench.chip.power_cycle()
    bench.now_s = 1.0
    bench.send("80 00 40 40")
    assert bench.chip.levels == (64, 0)


def test_a_dropped_packet_does_not_keep_the_timeout_from_tripping(bench: Bench) -> None:
    bench.send(f"80 0E 03 11 {BOTH_AHEAD}")
    bench.now_s = 0.2
    bench.send("80 00 7F 00")
    bench.now_s = 0.31
    bench.chip.tick()
    assert bench.world.commanded == STILL


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
    bench = old_board()
    bench.now_s = at_s
    bench.chip.receive(bytes.fromhex(first))
    bench.now_s = 3.0
    bench.chip.receive(bytes.fromhex(BOTH_AHEAD))
    assert bench.chip.levels == ((127, 127) if hears else (0, 0))


def test_old_board_must_hear_it_again_when_its_power_was_off() -> None:
    bench = old_board()
    bench.now_s = 2.0
    bench.chip.receive(bytes.fromhex(f"AA {BOTH_AHEAD}"))
    bench.chip.power_cycle()
    assert bench.chip.levels == (0, 0)
    for bench.now_s, sent, level in ((3.0, f"AA {BOTH_AHEAD}", 0), (4.0, f"AA {BOTH_AHEAD}", 127)):
        bench.chip.receive(bytes.fromhex(sent))
        assert bench.chip.levels == (level, level)
