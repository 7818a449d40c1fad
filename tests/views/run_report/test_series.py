"""Columns made ready for drawing: what is unknown stays a gap."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.views.run_report.data import Floats
from wayfarer.views.run_report.series import (
    ValueSpan,
    around,
    broken_at_gaps,
    broken_beside,
    pieces,
    spans,
    without_unknown,
)


def times(values: Floats) -> Floats:
    return np.arange(values.size, dtype=np.float64)


def test_line_is_broken_where_nothing_was_logged() -> None:
    t_s, values = broken_at_gaps(np.array([0.0, 0.5, 9.0, 9.5]), np.array([1.0, 2.0, 3.0, 4.0]))
    np.testing.assert_array_equal(values, [1.0, 2.0, np.nan, 3.0, 4.0])
    assert (np.diff(t_s) >= 0).all()


def test_line_beside_ticks_is_broken_where_they_are_and_where_it_was_silent() -> None:
    ticks_s = np.array([0.0, 0.5, 1.0, 5.0, 5.5, 6.0, 6.5, 7.0])
    _, values = broken_beside(ticks_s, np.array([0.2, 0.9, 5.1, 5.3, 7.0]), np.arange(5.0), 1.5)
    np.testing.assert_array_equal(values, [0.0, 1.0, np.nan, 2.0, 3.0, np.nan, 4.0])


@given(st.lists(st.floats(0.0, 359.9), min_size=1, max_size=50).map(np.array), st.floats(0.0, 359.0))
def test_headings_never_jump_round_the_back(headings_deg: Floats, centre_deg: float) -> None:
    _, drawn_deg = around(times(headings_deg), headings_deg, centre_deg)
    assert not (np.abs(np.diff(drawn_deg)) > 180.0).any()
    known_deg = drawn_deg[~np.isnan(drawn_deg)]
    apart_deg = (known_deg + centre_deg - headings_deg) % 360.0
    assert np.minimum(apart_deg, 360.0 - apart_deg).max() < 1e-6


def test_heading_that_wavers_at_north_is_one_line() -> None:
    _, drawn_deg = around(times(np.zeros(4)), np.array([359.0, 1.0, 358.0, 2.0]), 0.0)
    assert drawn_deg.tolist() == [-1.0, 1.0, -2.0, 2.0]


def test_spans_join_equal_values_and_end_at_gaps() -> None:
    t_s = np.array([0.0, 0.5, 1.0, 1.5, 9.0, 9.5])
    phases = np.array([1.0, 1.0, 2.0, 2.0, 2.0, np.nan])
    assert spans(t_s, phases) == [ValueSpan(0.0, 1.0, 1.0), ValueSpan(1.0, 1.5, 2.0), ValueSpan(9.0, 9.5, 2.0)]


def test_more_spans_than_can_be_seen_are_sampled() -> None:
    found = spans(times(np.zeros(1000)) * 0.05, times(np.zeros(1000)) % 3.0, samples=50)
    assert 0 < len(found) <= 50
    assert {span.value for span in found} == {0.0, 1.0, 2.0}


@pytest.mark.parametrize("count", [0, 1])
def test_too_little_to_draw_is_no_error(count: int) -> None:
    few = np.zeros(count)
    assert len(spans(few, few)) == count
    assert broken_at_gaps(few, few)[0].size == around(few, few, 0.0)[0].size == count
    assert pieces((few, few), np.ones(count, np.bool_))[0].size == 0


def test_a_piece_goes_on_to_where_the_next_begins() -> None:
    way = np.arange(6.0)
    inside = np.array([True, True, False, True, False, True])
    east_m, north_m = pieces((way, way + 10.0), inside)
    np.testing.assert_array_equal(east_m, [0.0, 1.0, 2.0, np.nan, 3.0, 4.0, np.nan])
    np.testing.assert_array_equal(north_m, east_m + 10.0)


def test_readings_of_a_slow_sensor_are_joined() -> None:
    t_s, values = without_unknown(np.arange(4.0), np.array([np.nan, 1.0, np.nan, 2.0]))
    assert (t_s.tolist(), values.tolist()) == ([1.0, 3.0], [1.0, 2.0])
