"""The sites of the field trials: layouts that anybody can draw again, on which a way out exists."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from math import hypot

import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from tests.simhal.forest_lines import lines_of
from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.paper import FIELD_TRIALS
from wayfarer.experiments.settings import CampaignSettings, sentences
from wayfarer.simhal.world.forest import Forest, check_forest
from wayfarer.simhal.world.forest_file import forests_in
from wayfarer.simhal.world.generate import Draw
from wayfarer.simhal.world.shortest_path import shortest_path_m
from wayfarer.simhal.world.sites import SITES, FieldSite, SiteLayout

FOREST_ROVER, MINI_ROVER = (load_rover(name).vehicle for name in ("forestrover", "minirover"))

shortest_paths = pytest.mark.skipif(
    find_spec("skfmm") is None, reason="scikit-fmm is not installed: pip install '.[hardware]'"
)
few = settings(max_examples=2, phases=[Phase.explicit, Phase.generate])  # a layout takes up to half a second
sites = st.sampled_from(sorted(SITES))
numbers = st.integers(0, 10_000)


@cache
def layout(site: str, number: int = 0, seed: int = 0) -> Forest:
    return SITES[site].layout(number, seed, FOREST_ROVER)


@few
@given(sites, numbers, numbers)
@example("forest-escape", 0, 0)  # a branch that the edge of the world cuts off has another bearing
def test_layout_follows_from_its_numbers_and_serves_both_rovers(site: str, number: int, seed: int) -> None:
    forest = layout(site, number, seed)
    check_forest(forest)
    assert forest == SITES[site].layout(number, seed, MINI_ROVER)


@shortest_paths
@few
@given(sites, numbers, numbers)
def test_rover_starts_free_and_has_a_way_out(site: str, number: int, seed: int) -> None:
    forest = layout(site, number, seed)
    reach_m = hypot(FOREST_ROVER.length_m, FOREST_ROVER.width_m) / 2
    assert all(trunk.distance_m(*forest.start_m) > reach_m + d_m / 2 for trunk, d_m in forest.thick_trunks)
    ways_m = [shortest_path_m(forest, vehicle.width_m) for vehicle in (MINI_ROVER, FOREST_ROVER)]
    straight_m = forest.goal_y_m - forest.start_m[1]
    assert all(way_m is not None and way_m > straight_m - 0.05 for way_m in ways_m)


@pytest.mark.parametrize("site", SITES)
def test_another_number_or_seed_is_another_layout(site: str) -> None:
    assert len({layout(site), layout(site, number=1), layout(site, seed=1)}) == 3


def test_two_sites_never_share_random_numbers() -> None:
    def first_numbers(name: str) -> list[float]:
        drawn: list[float] = []

        def lay(draw: Draw) -> SiteLayout:
            drawn.extend(draw(0.0, 1.0) for _ in range(3))
            return SiteLayout((25.0, 20.0), 5.0)

        FieldSite(name, 1.0, lay).layout(0, 0, MINI_ROVER)
        return drawn

    names = ("extended-maze", "forest-escape", "forest-maze")
    assert len({tuple(first_numbers(name)) for name in names}) == len(names)


def test_closed_ground_is_drawn_again() -> None:
    drawn = []

    def closed_at_first(_draw: Draw) -> SiteLayout:
        ground = SiteLayout((25.0, 20.0), 5.0)
        drawn.append(ground)
        if len(drawn) < 3:
            for (x_m, y_m), bearing_deg in zip([(25, 22), (25, 18), (23, 20), (27, 20)], [90, 90, 0, 0], strict=True):
                ground.lay_branch((x_m, y_m), bearing_deg, 4.2, 0.1)
        return ground

    assert FieldSite("closed", 1.0, closed_at_first).layout(0, 0, MINI_ROVER).trunks == ()
    assert len(drawn) == 3


def test_start_under_a_branch_is_drawn_again() -> None:
    drawn = []

    def across_the_start(_draw: Draw) -> SiteLayout:
        ground = SiteLayout((25.0, 20.0), 5.0)
        drawn.append(ground)
        if len(drawn) < 2:
            ground.lay_branch((25.3, 20.0), 0.0, 1.0, 0.02)
        return ground

    assert FieldSite("covered", 1.0, across_the_start).layout(0, 0, MINI_ROVER).trunks == ()


def test_sites_are_what_the_paper_describes() -> None:
    challenge = layout("forest-escape")
    assert challenge.goal_y_m - challenge.start_m[1] == 45.0
    maze, clutter = layout("extended-maze"), layout("dense-obstruction")
    long_m = max(trunk.length_m for trunk in clutter.trunks)
    assert max(trunk.length_m for trunk in maze.trunks) > long_m
    near = [trunk for trunk in clutter.trunks if trunk.distance_m(*clutter.start_m) < 1.5]
    bearings = {(trunk.x0_m > 25.0, trunk.y0_m > 20.0) for trunk in near}
    assert len(bearings) == 4  # on all sides


@shortest_paths
def test_some_gaps_let_only_the_smaller_rover_through() -> None:
    ways = [
        [
            shortest_path_m(layout("dense-obstruction", number), vehicle.width_m)
            for vehicle in (MINI_ROVER, FOREST_ROVER)
        ]
        for number in range(2)
    ]
    assert any(mini_m < forest_m - 0.3 for mini_m, forest_m in ways if mini_m is not None and forest_m is not None)


def test_layout_is_the_same_after_a_file() -> None:
    forest = layout("dense-obstruction")
    assert forests_in("site.jsonl", lines_of([forest])) == [forest]


def test_command_and_table_know_the_same_scenarios() -> None:
    told = sentences(CampaignSettings)["site"]
    assert all(name in told for name in SITES)
    assert {site for site, _ in FIELD_TRIALS} < set(SITES)
