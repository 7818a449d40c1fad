"""Generated forests: the same for ever, sound, and like the reference forests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from hashlib import blake2b
from itertools import combinations, pairwise
from math import atan2, degrees, hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.simhal.forest_lines import lines_of
from wayfarer.simhal.world.forest import Forest, Lean, Trunk, check_forest
from wayfarer.simhal.world.forest_file import read_forest_file
from wayfarer.simhal.world.generate import DIVIDED, MAX_TILT_DEG, START_AREA, generate_forest

numbers = st.integers(0, 2**63)


@pytest.fixture(scope="module")
def reference() -> tuple[Forest, ...]:
    """One forest of each of the 250 reference layouts."""
    return read_forest_file("reference").forests[::2]


@pytest.fixture(scope="module")
def generated() -> list[Forest]:
    return [generate_forest(layout, 0, 0) for layout in range(250)]


def test_forests_stay_the_same_for_ever() -> None:
    forests = [generate_forest(layout, noise, 0) for layout in range(20) for noise in range(2)]
    assert blake2b(lines_of(forests), digest_size=8).hexdigest() == "5bdab271b9f645e3"


def test_trunks_depend_on_layout_and_seed_alone() -> None:
    forest = generate_forest(7, 1, 3)
    assert generate_forest(7, 2, 3).trunks == forest.trunks
    assert generate_forest(8, 1, 3).trunks != forest.trunks
    assert generate_forest(7, 1, 4).trunks != forest.trunks


def test_trees_depend_on_layout_noise_and_seed() -> None:
    forests = [generate_forest(*key) for key in ((7, 1, 3), (7, 2, 3), (8, 1, 3), (7, 1, 4))]
    trees_m = [tree_m for forest in forests for tree_m in forest.trees_m]
    assert len(set(trees_m)) == 4 * 20


def test_negative_number_is_refused() -> None:
    with pytest.raises(ValueError, match="non-negative"):
        generate_forest(0, 0, -1)


@given(layout=numbers, noise=numbers, seed=numbers)
def test_every_forest_is_sound(layout: int, noise: int, seed: int) -> None:
    forest = generate_forest(layout, noise, seed)
    check_forest(forest)
    assert (forest.forest, forest.noise) == (layout, noise)
    assert len(forest.trees_m) == 20
    assert_trees_stand_free(forest)
    for trunk in forest.trunks:
        assert trunk.length_m >= 0.05
        assert_lies_inside_the_square(trunk)
        assert_misses_the_clearing(trunk)


def assert_trees_stand_free(forest: Forest) -> None:
    for x_m, y_m in forest.trees_m:
        assert min(x_m, y_m) >= 0.25
        assert max(x_m, y_m) <= 49.75
        assert max(abs(x_m - 25.0), abs(y_m - 12.5)) > 1.5
        assert all(trunk.distance_m(x_m, y_m) > 0.25 + 0.15 for trunk in forest.trunks)
    for (x0_m, y0_m), (x1_m, y1_m) in combinations(forest.trees_m, 2):
        assert hypot(x1_m - x0_m, y1_m - y0_m) > 0.5


def assert_lies_inside_the_square(trunk: Trunk) -> None:
    assert DIVIDED.west_m <= min(trunk.x0_m, trunk.x1_m) <= max(trunk.x0_m, trunk.x1_m) <= DIVIDED.east_m
    assert DIVIDED.south_m <= min(trunk.y0_m, trunk.y1_m) <= max(trunk.y0_m, trunk.y1_m) <= DIVIDED.north_m


def assert_misses_the_clearing(trunk: Trunk) -> None:
    for step in range(101):
        x_m = trunk.x0_m + step / 100 * (trunk.x1_m - trunk.x0_m)
        y_m = trunk.y0_m + step / 100 * (trunk.y1_m - trunk.y0_m)
        rounding_m = 0.001
        assert not (
            START_AREA.west_m + rounding_m < x_m < START_AREA.east_m - rounding_m
            and START_AREA.south_m + rounding_m < y_m < START_AREA.north_m - rounding_m
        )


def lengths_m(forest: Forest) -> list[float]:
    return [trunk.length_m for trunk in forest.trunks]


def tilts_deg(forest: Forest) -> list[float]:
    """Angles from the axis, x or y, that a trunk lies along."""
    return [(bearing_deg(trunk) + 45.0) % 90.0 - 45.0 for trunk in forest.trunks if trunk.length_m > 0.5]


def share(forest: Forest, lean: Lean) -> float:
    return sum(trunk.lean == lean for trunk in forest.trunks) / len(forest.trunks)


def gaps_m(forest: Forest) -> list[float]:
    """Distances between trunks, next to each other in the list, that lie on one line."""
    found_m = []
    for near, far in pairwise(trunk for trunk in forest.trunks if trunk.length_m > 0.5):
        gap = Trunk(near.x1_m, near.y1_m, far.x0_m, far.y0_m, near.lean)
        on_one_line = all(abs(bearing_deg(near) - bearing_deg(other)) < 1.0 for other in (gap, far))
        if on_one_line:
            found_m.append(gap.length_m)
    return found_m


def bearing_deg(trunk: Trunk) -> float:
    return degrees(atan2(trunk.x1_m - trunk.x0_m, trunk.y1_m - trunk.y0_m))


MEASURES: dict[str, Callable[[Forest], list[float]]] = {
    "count": lambda forest: [len(forest.trunks)],
    "total length": lambda forest: [sum(lengths_m(forest))],
    "lengths": lengths_m,
    "tilts": tilts_deg,
    "share to the right": lambda forest: [share(forest, "right")],
    "share across": lambda forest: [share(forest, "across")],
    "middles in x": lambda forest: [(trunk.x0_m + trunk.x1_m) / 2.0 for trunk in forest.trunks],
    "middles in y": lambda forest: [(trunk.y0_m + trunk.y1_m) / 2.0 for trunk in forest.trunks],
    "gaps": gaps_m,
}


@pytest.mark.parametrize("measure", MEASURES.values(), ids=MEASURES)
def test_layouts_are_distributed_like_the_reference(
    measure: Callable[[Forest], list[float]], reference: Sequence[Forest], generated: list[Forest]
) -> None:
    from scipy.stats import ks_2samp  # not at the top: see test_statistics.py

    expected = [value for forest in reference for value in measure(forest)]
    drawn = [value for forest in generated for value in measure(forest)]
    assert ks_2samp(expected, drawn).pvalue > 0.01


def test_tilts_reach_the_whole_range_and_no_further(generated: list[Forest]) -> None:
    tilts = [tilt for forest in generated for tilt in tilts_deg(forest)]
    assert MAX_TILT_DEG - 0.5 < max(tilts) < MAX_TILT_DEG + 0.5
    assert -MAX_TILT_DEG - 0.5 < min(tilts) < -MAX_TILT_DEG + 0.5
