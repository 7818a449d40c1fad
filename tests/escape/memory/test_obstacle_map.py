"""What is remembered of contacts: which trunk they are of, how far it is assumed to go, and when it is forgotten."""

from __future__ import annotations

from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.escape.memory.obstacle_map import (
    HALF_FIRST,
    MOST_CONTACTS,
    MOST_GROWTH,
    ObstacleMap,
    Point,
    price_m,
)

WIDTH_M = 0.4
REACH_M, LINK_M = 1.2, 2.4
AHEAD, RIGHT = (1.0, 0.0), (0.0, 1.0)
COORDINATE = st.floats(-20.0, 20.0)


def mapped(*places: Point, course: Point = AHEAD) -> ObstacleMap:
    """A map of contacts, each a metre of path after the last."""
    made = ObstacleMap(WIDTH_M, REACH_M, LINK_M, forget_m=200.0)
    for path_m, place in enumerate(places):
        made.add(place, course, float(path_m))
    return made


def wall(contacts: int) -> ObstacleMap:
    """A trunk across the goal heading that was met every metre."""
    return mapped(*((5.0, float(right)) for right in range(contacts)))


def longest_guess_m(memory: ObstacleMap) -> float:
    return max(hypot(b.ahead1_m - b.ahead0_m, b.right1_m - b.right0_m) for b in memory.barriers(0.0)[-2:])


def assert_places(found: list[Point], expected: list[Point]) -> None:
    for place, wanted in zip(sorted(found), expected, strict=True):
        assert place == pytest.approx(wanted)


def test_first_contact_is_wood_across_the_course() -> None:
    (trunk,) = (ahead := mapped((5.0, 1.0))).trunks
    half_m = HALF_FIRST * WIDTH_M
    assert_places(ahead.line(trunk), [(5.0, 1.0 - half_m), (5.0, 1.0 + half_m)])
    (trunk,) = (right := mapped((5.0, 1.0), course=RIGHT)).trunks
    assert_places(right.line(trunk), [(5.0 - half_m, 1.0), (5.0 + half_m, 1.0)])


def test_way_turns_beyond_both_ends_and_before_the_wood() -> None:
    places = sorted(mapped((5.0, 0.0)).waypoints(), key=lambda place: place[1])
    assert [right < 0.0 for _, right in places] == [True, False]
    for ahead, right in places:
        assert abs(right) > HALF_FIRST * WIDTH_M
        assert ahead < 5.0


def test_two_contacts_near_each_other_are_one_trunk_and_two_far_apart_are_two() -> None:
    assert len(mapped((5.0, 0.0), (5.0, LINK_M - 0.1)).trunks) == 1
    assert len(mapped((5.0, 0.0), (5.0, LINK_M + 0.1)).trunks) == 2


def test_contact_before_the_first_end_is_put_before_it() -> None:
    (trunk,) = mapped((5.0, 0.0), (5.0, 1.5), (5.0, -1.0)).trunks
    assert trunk.points == [(5.0, -1.0), (5.0, 0.0), (5.0, 1.5)]


def test_longer_trunk_is_assumed_to_go_on_further_up_to_a_limit() -> None:
    guesses_m = [longest_guess_m(wall(contacts)) for contacts in range(2, 9)]
    assert guesses_m[0] == pytest.approx(REACH_M)
    assert guesses_m[1] > guesses_m[0]
    assert guesses_m == sorted(guesses_m)
    assert guesses_m[-1] == pytest.approx(MOST_GROWTH * REACH_M)


def test_contact_met_along_a_trunk_makes_a_corner() -> None:
    memory = wall(3)
    memory.add((5.0, 3.0), RIGHT, 3.0)
    along, corner = memory.trunks
    assert along.points[-1] == corner.points[0] == (5.0, 3.0)
    (a0, r0), (a1, r1) = memory.line(corner)
    assert r0 == pytest.approx(r1), "wood across the course, so from the trunk's end ahead and back"
    assert abs(a1 - a0) == pytest.approx(2 * HALF_FIRST * WIDTH_M)


def test_trunk_that_was_driven_across_is_cut_there() -> None:
    memory = wall(4)
    assert memory.drive((4.5, 1.5), (5.5, 1.5))
    assert sorted(trunk.points for trunk in memory.trunks) == [[(5.0, 0.0), (5.0, 1.0)], [(5.0, 2.0), (5.0, 3.0)]]
    barriers = memory.barriers(3.0)
    assert price_m(barriers, 4.5, 1.5, 5.5, 1.5) < price_m(barriers, 4.5, 0.5, 5.5, 0.5)


def test_single_contact_that_was_driven_across_is_forgotten() -> None:
    memory = mapped((5.0, 0.0))
    assert memory.drive((4.5, 0.1), (5.5, 0.1))
    assert memory.trunks == []


@pytest.mark.parametrize(
    ("start", "end"), [((4.0, 1.5), (5.1, 1.5)), ((4.9, 1.5), (6.0, 1.5)), ((4.0, 9.0), (6.0, 9.0))]
)
def test_small_error_of_dead_reckoning_cuts_nothing(start: Point, end: Point) -> None:
    memory = wall(4)
    assert not memory.drive(start, end)
    assert len(memory.trunks) == 1


def test_belief_falls_to_nothing_over_the_path_since_the_latest_contact() -> None:
    memory = wall(3)
    (trunk,) = memory.trunks
    assert [memory.belief(trunk, path_m) for path_m in (2.0, 102.0, 202.0, 999.0)] == pytest.approx(
        [1.0, 0.5, 0.0, 0.0]
    )
    memory.add((5.0, 40.0), AHEAD, 300.0)
    assert trunk not in memory.trunks


@given(st.lists(st.tuples(COORDINATE, COORDINATE, st.sampled_from([AHEAD, RIGHT, (-1.0, 0.0)])), max_size=150))
def test_contacts_that_are_kept_are_bounded(contacts: list[tuple[float, float, Point]]) -> None:
    memory = mapped()
    for ahead, right, course in contacts:
        memory.add((ahead, right), course, 0.0)
        # A contact in a corner is a point of two trunks.
        assert sum(len(trunk.points) for trunk in memory.trunks) <= MOST_CONTACTS + 1
    memory.barriers(0.0)
    memory.waypoints()


def test_oldest_trunk_makes_room() -> None:
    memory = mapped(*((0.0, 10.0 * number) for number in range(MOST_CONTACTS + 5)))
    assert len(memory.trunks) == MOST_CONTACTS
    assert memory.trunks[0].points == [(0.0, 50.0)]
