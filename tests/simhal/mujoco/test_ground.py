"""The ground under the wheels: how high it is, and where mud lies."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import exp, pi, sqrt

import pytest

from tests.simhal.clearing import STEADY
from tests.simhal.mujoco.fields import BODY
from wayfarer.simhal.mujoco.ground import BUMP_M, CELL_M, MUD_CELL_M, MUD_RADIUS_M, Mud, rough_ground
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING


def test_rough_ground_has_its_standard_deviation_and_no_steps() -> None:
    field = rough_ground(0.02, RandomStreams(1))
    heights_m = field.heights_m
    assert heights_m.std() == pytest.approx(0.02, rel=1e-6)
    # White noise under a Gaussian of half BUMP_M: how much less alike heights are a cell apart.
    alike = exp(-((CELL_M / BUMP_M) ** 2))
    assert (heights_m[1:] - heights_m[:-1]).std() == pytest.approx(0.02 * sqrt(2.0 * (1.0 - alike)), rel=0.03)
    assert field.top_m(25.0, 25.0, 0.3) >= heights_m[heights_m.shape[0] // 2, heights_m.shape[1] // 2]


@pytest.mark.parametrize("width_m", [0.0, BODY.width_m])
def test_straight_ways_meet_mud_as_often_as_slips(width_m: float) -> None:
    """Mud begins where a row across the way has some and the row before had none.

    A row is bare if no patch's middle lies within a radius of it; so are two rows one cell apart. Middles are a Poisson
    process, so the expected number follows from both areas. 360 m of way a seed, on columns further apart than patches
    are wide; with 40 seeds the standard deviation is 2 %.
    """
    mean_m, seeds, ways_m, rows = 5.0, 40, range(5, 50, 5), range(50, 450)
    forest, physics = replace(CLEARING, start_m=(1.0, 1.0)), replace(STEADY, slip_mean_m=mean_m)
    half = round(width_m / 2.0 / MUD_CELL_M)
    begins = 0
    for seed in range(seeds):
        mud = Mud(forest, physics, width_m, RandomStreams(seed))
        for way_m in ways_m:
            columns = [way_m + (off + 0.5) * MUD_CELL_M for off in range(-half, half + 1)]
            muddy = [any(mud.is_muddy(x_m, (row + 0.5) * MUD_CELL_M) for x_m in columns) for row in rows]
            begins += sum(now and not before for before, now in pairwise(muddy))
    per_m2 = 1.0 / ((2.0 * MUD_RADIUS_M + width_m) * mean_m)
    bare = exp(-per_m2 * (pi * MUD_RADIUS_M**2 + 2.0 * MUD_RADIUS_M * 2.0 * half * MUD_CELL_M))
    expected = seeds * len(ways_m) * (len(rows) - 1) * bare * (1.0 - exp(-MUD_CELL_M / mean_m))
    assert begins == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize("slip_mean_m", [0.1, 1e-300])
def test_ground_holds_no_more_mud_than_it_has_room_for(slip_mean_m: float) -> None:
    """Without a bound the second would lay patches out for ever."""
    mud = Mud(CLEARING, replace(STEADY, slip_mean_m=slip_mean_m), BODY.width_m, RandomStreams(0))
    places = [(x / 2.0, y / 2.0) for x in range(2, 98) for y in range(40, 98)]
    assert sum(mud.is_muddy(*place) for place in places) / len(places) == pytest.approx(0.99, abs=0.005)


def test_no_mud_where_the_rover_starts() -> None:
    mud = Mud(CLEARING, replace(STEADY, slip_mean_m=0.5), BODY.width_m, RandomStreams(0))
    assert mud.anywhere
    assert not any(mud.is_muddy(25.0 + east / 10.0, 12.5 + north / 10.0) for east in range(-5, 6) for north in range(6))
