"""Compass angles: wrap-around is where published code goes wrong."""

from __future__ import annotations

from math import inf, isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.angles import (
    axis_offset_deg,
    circular_mean,
    clamp,
    coordinates_deg,
    displacement_m,
    offset_m,
    wrap180,
    wrap360,
)
from wayfarer.hal import PositionFix

ANGLES = st.floats(-1e6, 1e6)


@given(ANGLES)
def test_wrapped_angles_stay_in_their_ranges(angle_deg: float) -> None:
    assert -180.0 <= wrap180(angle_deg) < 180.0
    assert 0.0 <= wrap360(angle_deg) < 360.0
    assert -90.0 <= axis_offset_deg(angle_deg, 0.0) < 90.0


@given(st.integers(-100_000, 100_000), st.integers(-20, 20))
def test_whole_turns_change_nothing(angle_64: int, turns: int) -> None:
    angle_deg, turned_deg = angle_64 / 64, angle_64 / 64 + turns * 360
    assert wrap180(turned_deg) == wrap180(angle_deg)
    assert wrap360(turned_deg) == wrap360(angle_deg)
    assert axis_offset_deg(angle_deg + turns * 180, 0.0) == axis_offset_deg(angle_deg, 0.0)


@pytest.mark.parametrize(
    ("angle_deg", "signed_deg", "heading_deg"),
    [(0, 0, 0), (180, -180, 180), (-180, -180, 180), (359, -1, 359), (-1, -1, 359), (540, -180, 180), (-1e-20, 0, 0)],
)
def test_known_wraps(angle_deg: float, signed_deg: float, heading_deg: float) -> None:
    assert wrap180(angle_deg) == signed_deg
    assert wrap360(angle_deg) == heading_deg


@pytest.mark.parametrize(
    ("axis_deg", "heading_deg", "offset_deg"), [(10, 0, 10), (170, 0, -10), (90, 0, -90), (10, 350, 20), (0, 180, 0)]
)
def test_axis_has_no_direction(axis_deg: float, heading_deg: float, offset_deg: float) -> None:
    assert axis_offset_deg(axis_deg, heading_deg) == offset_deg


@pytest.mark.parametrize(
    ("angles_deg", "mean_deg"), [([359, 1], 0), ([350, 20], 5), ([90], 90), ([179, 181], 180), ([271, 269], 270)]
)
def test_mean_goes_the_short_way_round(angles_deg: list[float], mean_deg: float) -> None:
    mean, length = circular_mean(angles_deg)
    assert wrap180(mean - mean_deg) == pytest.approx(0.0, abs=1e-9)
    assert 0.9 < length <= 1.0


def test_opposite_angles_have_no_mean() -> None:
    assert circular_mean([0, 180])[1] == pytest.approx(0.0, abs=1e-9)


def test_mean_of_nothing_is_an_error() -> None:
    with pytest.raises(ValueError, match="no angles"):
        circular_mean([])


@given(st.lists(st.floats(-20, 20), min_size=1, max_size=10), st.floats(0, 360))
def test_mean_turns_with_its_angles(angles_deg: list[float], by_deg: float) -> None:
    turned, _ = circular_mean([angle + by_deg for angle in angles_deg])
    assert wrap180(turned - circular_mean(angles_deg)[0] - by_deg) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("heading_deg", "moved_m", "north_and_east_m"),
    [(0, (2, 0), (2, 0)), (90, (2, 0), (0, 2)), (180, (2, 1), (-2, -1)), (270, (-2, 0), (0, 2)), (90, (0, 1), (-1, 0))],
)
def test_displacement_is_along_the_heading_and_to_its_right(
    heading_deg: float, moved_m: tuple[float, float], north_and_east_m: tuple[float, float]
) -> None:
    assert displacement_m(heading_deg, *moved_m) == pytest.approx(north_and_east_m, abs=1e-12)


def place(latitude_deg: float, longitude_deg: float) -> PositionFix:
    return PositionFix(0.0, latitude_deg, longitude_deg, 3.0)


@given(st.floats(-80.0, 80.0), st.floats(-180.0, 180.0), st.floats(-5e3, 5e3), st.floats(-5e3, 5e3))
def test_offset_leads_back_from_coordinates_also_over_the_date_line(
    latitude_deg: float, longitude_deg: float, north_m: float, east_m: float
) -> None:
    origin = place(latitude_deg, longitude_deg)
    there = place(*coordinates_deg(origin, north_m, east_m))
    beyond = place(there.latitude_deg, wrap180(there.longitude_deg))
    assert offset_m(origin, there) == pytest.approx((north_m, east_m), abs=1e-6)
    assert offset_m(origin, beyond) == pytest.approx((north_m, east_m), abs=1e-6)


def test_offset_of_a_minute_of_arc_is_a_nautical_mile() -> None:
    assert offset_m(place(47.0, 8.0), place(47.0 + 1 / 60, 8.0)) == pytest.approx((1852.0, 0.0), rel=0.007)
    assert offset_m(place(60.0, 8.0), place(60.0, 8.0 - 1 / 60)) == pytest.approx((0.0, -926.0), rel=0.007)


# -- values within bounds ----------------------------------------------------------------------------------------------


@given(st.floats(allow_nan=False), st.floats(-10.0, 0.0), st.floats(0.0, 10.0))
def test_value_is_itself_or_the_bound_that_it_is_beyond(value: float, low: float, high: float) -> None:
    within = clamp(value, low, high)
    assert low <= within <= high
    assert within == value or (within == low > value) or (within == high < value)


def test_upper_bound_counts_where_settings_cross() -> None:
    assert [clamp(value, 30.0, 20.0) for value in (10.0, 25.0, 40.0)] == [20.0] * 3


def test_infinity_is_bounded_and_nan_stays() -> None:
    assert (clamp(inf, -1.0, 1.0), clamp(-inf, -1.0, 1.0)) == (1.0, -1.0)
    assert isnan(clamp(nan, -1.0, 1.0))
