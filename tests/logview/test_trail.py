"""The way that pages and exports draw: bounded, and true to where the rover was."""

from __future__ import annotations

from itertools import pairwise
from math import dist

from hypothesis import given
from hypothesis import strategies as st

from wayfarer.logview.trail import Trail

STEPS = st.lists(
    st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.sampled_from(["follow", "probe", "back_off"])), max_size=300
)


def walk(trail: Trail, steps: list[tuple[float, float, str]]) -> list[tuple[float, float]]:
    """Follow steps, thinning as the page model does, and return every place."""
    east_m = north_m = 0.0
    places = []
    for index, (dx, dy, phase) in enumerate(steps):
        east_m, north_m = east_m + dx, north_m + dy
        places.append((east_m, north_m))
        trail.add(east_m, north_m, phase)
        if index % 7 == 0:
            trail.thin()
    return places


@given(steps=STEPS)
def test_way_is_bounded_begins_where_it_began_and_holds_only_places_that_were_visited(
    steps: list[tuple[float, float, str]],
) -> None:
    trail = Trail(most=20, spacing_m=0.05)
    places = walk(trail, steps)
    assert len(trail.points) <= 20 + 7
    if places:
        assert trail.points[0][:2] == places[0]
    rest = iter(places)
    assert all(point[:2] in rest for point in trail.points), "each is found after the one before it"


def test_standing_rover_leaves_one_point_however_its_dead_reckoning_trembles() -> None:
    trail = Trail(most=3000, spacing_m=0.05)
    for step in range(1000):
        trail.add(0.001 * (step % 2), 0.0, "halt")
    assert len(trail.points) == 1


def test_each_change_of_phase_that_moved_is_a_point() -> None:
    trail = Trail(most=3000, spacing_m=0.05)
    for step, phase in enumerate(["follow", "back_off", "turn_away", "probe"]):
        trail.add(0.01 * step, 0.0, phase)
    assert [phase for *_, phase in trail.points] == ["follow", "back_off", "turn_away", "probe"]


def test_thinning_keeps_first_and_last_and_halves_the_rest() -> None:
    trail = Trail(most=10, spacing_m=0.1)
    for step in range(12):
        trail.add(step, 0.0, "follow")
    assert trail.thin()
    assert [east_m for east_m, *_ in trail.points] == [0, 2, 4, 6, 8, 10, 11]
    assert not trail.thin()
    assert not trail.add(11.15, 0.0, "follow"), "the spacing has doubled"


@given(steps=STEPS)
def test_way_ends_within_its_spacing_of_where_the_rover_is(steps: list[tuple[float, float, str]]) -> None:
    trail = Trail(most=20, spacing_m=0.1)
    places = walk(trail, steps)
    if places:
        assert dist(trail.points[-1][:2], places[-1]) <= trail.spacing_m


def test_long_straight_way_is_thinned_evenly() -> None:
    trail = Trail(most=100, spacing_m=0.1)
    for step in range(10_000):
        trail.add(0.05 * step, 0.0)
        trail.thin()
    gaps_m = [dist(a[:2], b[:2]) for a, b in pairwise(trail.points)]
    assert 50 <= len(trail.points) <= 100
    assert max(gaps_m) <= 2.1 * min(gaps_m)
