"""A path of bounded size."""

from __future__ import annotations

from math import dist, hypot

from hypothesis import given
from hypothesis import strategies as st

from wayfarer.views.foxglove.path import ThinnedPath

METRES = st.floats(-1000.0, 1000.0)
WALKS = st.lists(st.tuples(METRES, METRES), min_size=1, max_size=200)


def thinned(walk: list[tuple[float, float]], most: int = 10) -> ThinnedPath[tuple[float, float]]:
    path = ThinnedPath(lambda x_m, y_m: (x_m, y_m), most=most)
    for place in walk:
        path.take(*place)
    return path


@given(WALKS)
def test_path_stays_small_and_keeps_its_beginning_and_its_order(walk: list[tuple[float, float]]) -> None:
    path = thinned(walk)
    assert len(path.points) <= 10
    assert path.points[0] == walk[0]
    rest = iter(walk)
    assert all(point in rest for point in path.points)  # each is found after the one before it


@given(WALKS)
def test_path_ends_within_its_spacing_of_where_the_rover_is(walk: list[tuple[float, float]]) -> None:
    path = thinned(walk)
    assert dist(path.points[-1], walk[-1]) <= path.spacing_m


def test_long_straight_path_is_thinned_evenly() -> None:
    path = thinned([(0.05 * step, 0.0) for step in range(10_000)], most=100)
    gaps_m = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in zip(path.points, path.points[1:], strict=False)]
    assert 50 <= len(path.points) <= 100
    assert max(gaps_m) <= 2.1 * min(gaps_m)


def test_standing_still_adds_nothing() -> None:
    path = thinned([(1.0, 1.0), (1.05, 1.0), (1.0, 1.05)])
    assert path.points == [(1.0, 1.0)]
    assert path.take(1.2, 1.0)
