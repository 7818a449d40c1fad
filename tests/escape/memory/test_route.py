"""The cheapest way among barriers."""

from __future__ import annotations

import itertools
from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.escape.memory import route
from wayfarer.escape.memory.obstacle_map import Barrier, Point, price_m
from wayfarer.escape.memory.route import BEYOND_M, find_way

WALL = [Barrier(5.0, -3.0, 5.0, 1.0, 30.0)]
LEFT, RIGHT = (4.9, -3.2), (4.9, 1.2)

COORDINATE = st.integers(-60, 60).map(lambda tenths: tenths / 10)
POINT = st.tuples(COORDINATE, COORDINATE)
POINTS = st.lists(POINT, max_size=8)
BARRIERS = st.lists(st.builds(Barrier, *[COORDINATE] * 4, st.sampled_from([0.5, 3.0, 30.0])), max_size=8)


def cost_m(start: Point, way: list[Point], barriers: list[Barrier]) -> float:
    """The length of a way to the goal line, with the prices of what it crosses."""
    line_m = max([start[0], *(max(barrier.ahead0_m, barrier.ahead1_m) for barrier in barriers)]) + BEYOND_M
    places = [start, *way, (line_m, (way or [start])[-1][1])]
    pieces = list(itertools.pairwise(places))
    # The last piece is along the goal heading: a place beyond the goal line has none left.
    length_m = sum(hypot(to[0] - at[0], to[1] - at[1]) for at, to in pieces[:-1]) + line_m - places[-2][0]
    return length_m + sum(price_m(barriers, *at, *to) for at, to in pieces)


def mirrored(barriers: list[Barrier]) -> list[Barrier]:
    return [Barrier(a0, -r0, a1, -r1, price) for a0, r0, a1, r1, price in barriers]


def test_way_is_straight_where_nothing_is_in_it() -> None:
    assert find_way((0.0, 0.0), [], []) == []
    assert find_way((0.0, 2.0), [LEFT, RIGHT], WALL) == []


def test_way_leads_round_the_nearer_of_two_ends() -> None:
    assert find_way((0.0, 0.0), [LEFT, RIGHT], WALL) == [RIGHT]
    assert find_way((0.0, -2.0), [LEFT, RIGHT], WALL) == [LEFT]


def test_way_leads_round_the_other_end_where_a_guess_is_at_the_nearer_one() -> None:
    guessed = [*WALL, Barrier(5.0, 1.0, 5.0, 8.0, 7.0)]
    assert find_way((0.0, 0.0), [LEFT, RIGHT], guessed) == [LEFT]


def test_way_through_a_guess_is_taken_where_every_other_is_longer() -> None:
    guessed = [Barrier(5.0, -30.0, 5.0, 1.0, 30.0), Barrier(5.0, 1.0, 5.0, 30.0, 2.0)]
    assert find_way((0.0, 0.0), [(4.9, -30.2), RIGHT, (4.9, 30.2)], guessed) == [RIGHT]


def test_way_out_of_a_pocket_leads_back_first() -> None:
    sides = [Barrier(0.0, side, 5.0, side, 30.0) for side in (-2.0, 2.0)]
    pocket = [Barrier(5.0, -2.0, 5.0, 2.0, 30.0), *sides]
    way = find_way((4.0, 0.5), [(-0.2, 0.0), (-0.2, -2.2), (-0.2, 2.2)], pocket)
    assert way[0] == (-0.2, 0.0)
    assert way[1:] in ([(-0.2, 2.2)], [(-0.2, -2.2)])


@given(POINT, POINTS, BARRIERS)
def test_way_never_costs_more_than_straight_ahead_across_everything(
    start: Point, waypoints: list[Point], barriers: list[Barrier]
) -> None:
    way = find_way(start, waypoints, barriers)
    assert set(way) <= set(waypoints)
    assert cost_m(start, way, barriers) <= cost_m(start, [], barriers) + 1e-9


@given(POINT, POINTS, BARRIERS)
def test_mirrored_world_has_a_way_of_the_same_cost(
    start: Point, waypoints: list[Point], barriers: list[Barrier]
) -> None:
    way = find_way(start, waypoints, barriers)
    back, other = (start[0], -start[1]), [(ahead, -right) for ahead, right in waypoints]
    across = find_way(back, other, mirrored(barriers))
    assert across == [(ahead, -right) for ahead, right in way]


def test_pieces_that_are_looked_at_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    looked = []

    def counted(*piece: object) -> float:
        looked.append(piece)
        return price_m(*piece)  # type: ignore[arg-type]

    monkeypatch.setattr(route, "price_m", counted)
    # Walls that each need two more turns, and no way that is cheap.
    waypoints = [(float(row), side * 40.0 + row) for row in range(80) for side in (-1, 1)]
    barriers = [Barrier(row + 0.5, -90.0, row + 0.5, 90.0, 1.0) for row in range(80)]
    find_way((0.0, 0.0), waypoints, barriers)
    assert len(looked) <= route.MOST_PIECES + len(waypoints)
