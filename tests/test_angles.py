"""Compass angles: wrap-around is where published code goes wrong."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.angles import axis_offset_deg, circular_mean, wrap180, wrap360

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
