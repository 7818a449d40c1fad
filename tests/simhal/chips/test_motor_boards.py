"""The deadman of each motor board stops the wheels at its own time, however late that is noticed."""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.chips.bench import BoardBench
from tests.simhal.clearing import steady_world
from wayfarer.simhal.chips.motor_boards import THUNDERBORG_FULL_LEVEL, SabertoothChip, ThunderBorgChip

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
