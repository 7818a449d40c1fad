"""Shortest paths: known lengths, no way at all, and the reference forests."""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2, hypot, inf, sqrt

import pytest

from wayfarer.simhal.world import shortest_path
from wayfarer.simhal.world.forest import CLEARING, Trunk
from wayfarer.simhal.world.forest_file import read_forest_file
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.shortest_path import has_path, shortest_path_m

pytest.importorskip("skfmm", reason="scikit-fmm is not installed: pip install '.[hardware]'")

WALL = Trunk(0.0, 30.0, 50.0, 30.0, "across")


def wall_with_gap(gap_m: float, middle_m: float = 25.0) -> tuple[Trunk, Trunk]:
    """A wall across the world; the gap is measured between the rounded ends of its trunks."""
    half_m = (gap_m + CLEARING.trunk_diameter_m) / 2.0
    return WALL._replace(x1_m=middle_m - half_m), WALL._replace(x0_m=middle_m + half_m)


@pytest.mark.parametrize("start_m", [(25.0, 12.5), (25.03, 12.41), (3.3, 30.0)])
@pytest.mark.parametrize("goal_y_m", [40.0, 49.97, 50.0])
def test_open_forest_is_crossed_straight(start_m: tuple[float, float], goal_y_m: float) -> None:
    forest = replace(CLEARING, start_m=start_m, goal_y_m=goal_y_m)
    assert shortest_path_m(forest) == pytest.approx(goal_y_m - start_m[1], abs=0.03)


@pytest.mark.parametrize("rover_width_m", [0.2, 0.4, 0.8])
def test_path_is_a_taut_string_around_the_round_end_of_a_trunk(rover_width_m: float) -> None:
    forest = replace(CLEARING, trunks=(WALL._replace(x1_m=35.0),))
    reach_m = (forest.trunk_diameter_m + rover_width_m) / 2.0
    distance_m = hypot(10.0, 17.5)  # start to end of trunk
    bearing_rad = atan2(10.0, 17.5) + asin(reach_m / distance_m)
    taut_m = sqrt(distance_m**2 - reach_m**2) + reach_m * bearing_rad + 20.0
    assert shortest_path_m(forest, rover_width_m) == pytest.approx(taut_m, abs=0.1)


def test_path_goes_round_a_tree() -> None:
    in_front = replace(CLEARING, trees_m=((25.0, 30.0),))
    assert shortest_path_m(replace(in_front, trunks=wall_with_gap(1.0))) is None, "it closes the gap"
    detour_m = 2.0 * (hypot(17.5, 0.45) - 17.5)
    length_m = shortest_path_m(in_front)
    assert length_m is not None
    assert 0.0 < length_m - 37.5 < detour_m + 0.05


@pytest.mark.parametrize(("gap_m", "passable"), [(0.2, False), (0.3, False), (0.5, True), (0.6, True)])
def test_gap_must_be_wider_than_the_rover(gap_m: float, passable: bool) -> None:
    forest = replace(CLEARING, trunks=wall_with_gap(gap_m))
    for width_m, fits in ((0.4, passable), (1.0, False), (0.1, True)):
        assert has_path(forest, width_m) is fits
        assert (shortest_path_m(forest, width_m) is not None) is fits


def test_world_edge_is_no_way_out() -> None:
    behind_a_wall = replace(CLEARING, trunks=(WALL,))
    assert shortest_path_m(behind_a_wall) is None
    assert not has_path(behind_a_wall)


def test_start_without_room_for_the_rover_has_no_way() -> None:
    forest = replace(CLEARING, trees_m=((25.6, 12.5), (24.4, 12.5)))
    assert shortest_path_m(forest) is not None
    assert shortest_path_m(forest, rover_width_m=0.9) is None
    assert has_path(forest)
    assert not has_path(forest, rover_width_m=0.9)


def test_obstacles_beyond_the_goal_line_do_not_matter() -> None:
    assert shortest_path_m(replace(CLEARING, goal_y_m=25.0, trunks=(WALL,))) == pytest.approx(12.5, abs=0.03)


@pytest.mark.parametrize("layout", [0, 1, 2])
def test_looking_at_likely_detours_first_changes_no_length(layout: int, monkeypatch: pytest.MonkeyPatch) -> None:
    forest = generate_forest(layout, 0, 0)
    length_m = shortest_path_m(forest)
    monkeypatch.setattr(shortest_path, "LIKELY_DETOUR", inf)
    assert shortest_path_m(forest) == pytest.approx(length_m, abs=1e-3)


def test_reference_lengths_are_reproduced() -> None:
    forests = read_forest_file("reference").forests[::62]
    assert all(map(has_path, forests))
    longer_m = [(shortest_path_m(forest) or inf) - (forest.shortest_path_m or inf) for forest in forests]
    assert all(0.0 < more_m < 0.2 for more_m in longer_m)  # the file's paths begin and end a little inside
