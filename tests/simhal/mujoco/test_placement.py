"""A rover that is high-centred is put down where it touches nothing."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, hypot

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.simhal.mujoco.fields import BODY, drive, rover_on, tree_at, trunk_across
from wayfarer.simhal.mujoco.model import NoRoom
from wayfarer.simhal.world.forest import CLEARING, Forest, Trunk

HUNG_ON = {
    "a trunk below its middle": trunk_across(12.5, 0.06),
    "a trunk below its rear": trunk_across(12.4, 0.06),
    "a trunk along its axis": replace(CLEARING, trunks=(Trunk(25.0, 11.5, 25.0, 13.5, "left"),), trunk_diameter_m=0.06),
    "two trees": replace(CLEARING, trees_m=((25.0, 12.75), (25.0, 12.25))),
}


@pytest.mark.parametrize("forest", HUNG_ON.values(), ids=HUNG_ON)
@pytest.mark.parametrize("snagged", [False, True])
def test_pulling_back_frees_a_body_from_what_it_lies_on(forest: Forest, snagged: bool) -> None:
    world = rover_on(0.8, forest=forest)  # put down on it
    world.set_faults(snagged=snagged)
    world.advance_to(1.0)
    world.pull_back(0.15)
    put_down_m = world.x_m, world.y_m
    assert hypot(put_down_m[0] - 25.0, put_down_m[1] - 12.5) < 2.0 * BODY.length_m
    world.advance_to(2.0)
    assert not world.high_centred
    assert world.touch is None
    assert (world.pitch_deg, world.roll_deg) == pytest.approx((0.0, 0.0), abs=0.1)
    assert (world.x_m, world.y_m) == pytest.approx(put_down_m, abs=0.002)
    drive(world, -0.5, -0.5, 2.0)
    if snagged:
        assert (world.x_m, world.y_m) == pytest.approx(put_down_m, abs=0.05), "it is held again, and there"
    else:
        assert world.reverse_m > 0.1


def test_pulling_back_goes_behind_what_the_front_has_climbed() -> None:
    world = rover_on(0.8, forest=trunk_across(12.52, 0.06))
    world.pull_back(0.15)
    assert world.y_m == pytest.approx(12.52 - BODY.length_m / 2.0 - 0.15, abs=0.06)
    assert degrees(world.heading_rad) == pytest.approx(0.0, abs=0.1)


def test_pulling_back_stops_at_what_is_behind() -> None:
    free, blocked = rover_on(0.5), rover_on(0.5, forest=tree_at(25.0, 12.5 - 0.25 - 0.30))
    for world in (free, blocked):
        world.pull_back(0.15)
    assert free.y_m == pytest.approx(12.35, abs=0.002)
    assert blocked.y_m == pytest.approx(12.39, abs=0.01)  # its belly ends 0.186 m behind its middle


def test_there_is_no_room_where_trees_stand_closer_than_the_body_is_wide() -> None:
    trees_m = tuple((23.0 + 0.25 * east, 10.5 + 0.25 * north) for east in range(17) for north in range(17))
    world = rover_on(0.8, forest=replace(CLEARING, trees_m=trees_m))
    with pytest.raises(NoRoom, match=r"no free ground near x = 2\d\.\d\d m"):
        world.pull_back(0.15)


@given(
    st.lists(st.tuples(st.floats(23.5, 26.5), st.floats(11.0, 14.0)), max_size=8),
    st.floats(0.0, 360.0),
    st.sampled_from([0.0, 0.02]),
)
@example([(25.0, 12.0), (25.0, 12.884066157958692)], 0.0, 0.02)  # at rest free of the tree, and rocked against it
@settings(max_examples=15, deadline=None)
def test_body_is_never_put_down_in_contact(
    trees_m: list[tuple[float, float]], heading_deg: float, roughness_m: float
) -> None:
    forest = replace(CLEARING, trees_m=tuple(trees_m), heading_deg=heading_deg)
    world = rover_on(0.5, forest=forest, roughness_m=roughness_m)
    world.pull_back(0.15)
    world.advance_to(world.t_s + 0.02)
    assert world.touch is None
