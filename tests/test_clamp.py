"""A value stays within its bounds, and what is no number is none afterwards."""

from __future__ import annotations

from math import inf, isnan, nan

from hypothesis import given
from hypothesis import strategies as st

from wayfarer.clamp import clamp


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
