"""Each choice of the algorithms, with and without contact."""

from __future__ import annotations

from random import Random

import pytest

from tests.escape.walk import SETTINGS, observation, touch
from wayfarer.escape import catalogue
from wayfarer.escape.api import CLOCKWISE, COUNTER_CLOCKWISE
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.escape.handler import TurnSide, short_stride
from wayfarer.hal import ContactReading, Side

CW, CCW = CLOCKWISE, COUNTER_CLOCKWISE


def rng() -> Random:
    return Random(1)


def drawn_sides(side: TurnSide, contact: ContactReading | None) -> set[int]:
    chance = rng()
    return {side(observation(contact=contact), SETTINGS, chance) for _ in range(40)}


@pytest.mark.parametrize("contact", [None, touch(), touch(Side.LEFT), touch(Side.RIGHT)])
def test_clockwise_and_either_do_not_look(contact: ContactReading | None) -> None:
    assert drawn_sides(catalogue.clockwise, contact) == {CW}
    assert drawn_sides(catalogue.either, contact) == {CW, CCW}


def test_either_side_is_as_likely() -> None:
    chance = rng()
    assert abs(sum(catalogue.either(observation(), SETTINGS, chance) for _ in range(2000))) < 150


NEITHER = [
    pytest.param(None, id="no sensor"),
    pytest.param(touch(), id="no touch"),
    pytest.param(touch(Side.FRONT), id="head-on"),
    pytest.param(touch(Side.LEFT, Side.RIGHT), id="both sides"),
]


@pytest.mark.parametrize("policy", [catalogue.away_else_clockwise, catalogue.away_else_either])
@pytest.mark.parametrize(
    ("sides", "expected"),
    [((Side.LEFT,), CW), ((Side.RIGHT,), CCW), ((Side.FRONT, Side.LEFT), CW), ((Side.REAR, Side.RIGHT), CCW)],
)
def test_turn_is_away_from_the_touched_side(policy: TurnSide, sides: tuple[Side, ...], expected: int) -> None:
    assert drawn_sides(policy, touch(*sides)) == {expected}


@pytest.mark.parametrize("contact", NEITHER)
def test_contact_that_favours_neither_side_leaves_the_default(contact: ContactReading | None) -> None:
    assert drawn_sides(catalogue.away_else_clockwise, contact) == {CW}
    assert drawn_sides(catalogue.away_else_either, contact) == {CW, CCW}


@pytest.mark.parametrize(
    ("bearing_deg", "goal_heading_deg", "expected_deg"),
    [
        (10.0, 0.0, 10.0),
        (170.0, 0.0, -10.0),
        (20.0, 0.0, 20.0),
        (160.0, 0.0, -20.0),
        (20.5, 0.0, None),
        (90.0, 0.0, None),
        (10.0, 180.0, 10.0),
        (5.0, 350.0, 15.0),
        (100.0, 270.0, 10.0),
        (None, 0.0, None),
    ],
)
def test_obstacle_is_compatible_within_20_degrees_of_the_goal(
    bearing_deg: float | None, goal_heading_deg: float, expected_deg: float | None
) -> None:
    seen = observation(goal_heading_deg=goal_heading_deg, contact=touch(Side.FRONT, bearing_deg=bearing_deg))
    assert catalogue.compatible_axis_deg(seen, SETTINGS) == expected_deg


def test_obstacle_is_unknown_without_a_contact_sensor() -> None:
    assert catalogue.compatible_axis_deg(observation(), SETTINGS) is None


@pytest.mark.parametrize(
    ("bearing_deg", "expected"), [(10.0, CW), (0.0, CW), (170.0, CCW), (90.0, CW), (135.0, CW), (None, CW)]
)
def test_oo_pledge_turns_to_where_a_compatible_obstacle_leans(bearing_deg: float | None, expected: int) -> None:
    assert drawn_sides(catalogue.along_else_clockwise, touch(Side.LEFT, bearing_deg=bearing_deg)) == {expected}


@pytest.mark.parametrize(
    ("heading_deg", "bearing_deg", "side", "angle_deg"),
    [
        (0.0, 10.0, CW, 10.0),
        (30.0, 10.0, CCW, 20.0),
        (350.0, 10.0, CW, 20.0),
        (10.0, 170.0, CCW, 20.0),
        (200.0, 10.0, CW, 170.0),
    ],
)
def test_oo_react_turns_onto_a_compatible_obstacle(
    heading_deg: float, bearing_deg: float, side: int, angle_deg: float
) -> None:
    seen = observation(heading_deg=heading_deg, contact=touch(Side.FRONT, bearing_deg=bearing_deg))
    assert catalogue.along_else_away(seen, SETTINGS, rng()) == side
    assert catalogue.along_angle(seen, SETTINGS, rng()) == angle_deg


@pytest.mark.parametrize("bearing_deg", [None, 90.0])
def test_oo_react_steers_away_from_any_other_obstacle(bearing_deg: float | None) -> None:
    contact = touch(Side.RIGHT, bearing_deg=bearing_deg)
    assert drawn_sides(catalogue.along_else_away, contact) == {CCW}
    assert catalogue.along_angle(observation(contact=contact), SETTINGS, rng()) == SETTINGS.turn_angle_deg


def test_fixed_angle_is_the_paper_s() -> None:
    assert catalogue.fixed_angle(observation(), SETTINGS, rng()) == 30.0
    assert short_stride(SETTINGS, rng()) == SETTINGS.react_stride_m


def test_catalogue_has_the_ten_algorithms_of_the_paper_and_says_who_needs_contact() -> None:
    assert len(CATALOGUE) == 10
    need_contact = {name for name, row in CATALOGUE.items() if "contact" in row.requires}
    assert need_contact == {name for name in CATALOGUE if name.startswith(("cv-", "oo-"))}
    assert all(row.summary and row.origin == "wayfarer" for row in CATALOGUE.values())
