"""Columns made ready for drawing: what is unknown stays a gap, and no extreme is lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.reports.data import Columns, Floats, ValueSpan, around, at_ticks, pieces, spans, thinned


def times(values: Floats) -> Floats:
    return np.arange(values.size, dtype=np.float64)


def ticks(t_s: list[float], *broken_before: int) -> Columns:
    stretch = np.zeros(len(t_s))
    for at in broken_before:
        stretch[at:] += 1
    return {"t_s": np.array(t_s), "stretch": stretch}


def test_line_is_broken_where_the_log_breaks_off() -> None:
    t_s, values = at_ticks(ticks([0.0, 0.5, 9.0, 9.5, 9.6], 2, 4), np.arange(5.0))
    np.testing.assert_array_equal(values, [0.0, 1.0, np.nan, 2.0, 3.0, np.nan, 4.0])
    assert (np.diff(t_s) >= 0).all()


@given(st.lists(st.floats(0.0, 359.9), min_size=1, max_size=50).map(np.array), st.floats(0.0, 359.0))
def test_headings_never_jump_round_the_back(headings_deg: Floats, centre_deg: float) -> None:
    _, drawn_deg = around((times(headings_deg), headings_deg), centre_deg)
    assert not (np.abs(np.diff(drawn_deg)) > 180.0).any()
    known_deg = drawn_deg[~np.isnan(drawn_deg)]
    apart_deg = (known_deg + centre_deg - headings_deg) % 360.0
    assert np.minimum(apart_deg, 360.0 - apart_deg).max() < 1e-6


def test_heading_that_wavers_at_north_is_one_line() -> None:
    _, drawn_deg = around((times(np.zeros(4)), np.array([359.0, 1.0, 358.0, 2.0])), 0.0)
    assert drawn_deg.tolist() == [-1.0, 1.0, -2.0, 2.0]


@given(st.lists(st.floats(-100.0, 100.0) | st.just(np.nan), min_size=1, max_size=200).map(np.array), st.integers(1, 20))
def test_thin_line_is_short_and_keeps_extremes_ends_and_gaps(values: Floats, bins: int) -> None:
    t_s, kept = thinned((times(values), values), bins)
    gaps = int(np.isnan(kept).sum())
    assert kept.size <= max(2 * bins, 2 * (bins + gaps) + gaps)
    assert (np.diff(t_s) > 0).all()
    np.testing.assert_array_equal(kept, values[t_s.astype(int)])
    if not np.isnan(values).all():
        assert (np.nanmin(kept), np.nanmax(kept)) == (np.nanmin(values), np.nanmax(values))
    for first, last in zip(t_s[:-1].astype(int), t_s[1:].astype(int), strict=True):
        if not np.isnan(values[[first, last]]).any():
            assert not np.isnan(values[first : last + 1]).any(), "a gap was bridged"


def test_spans_join_equal_values_and_end_where_the_log_breaks_off() -> None:
    phases = np.array([1.0, 1.0, 2.0, 2.0, 2.0, np.nan])
    found = spans(ticks([0.0, 0.5, 1.0, 1.5, 9.0, 9.5], 4), phases)
    assert found == [ValueSpan(0.0, 1.0, 1.0), ValueSpan(1.0, 1.5, 2.0), ValueSpan(9.0, 9.5, 2.0)]


def test_more_spans_than_can_be_seen_are_sampled() -> None:
    found = spans(ticks([number * 0.05 for number in range(1000)]), times(np.zeros(1000)) % 3.0, most=50)
    assert 0 < len(found) <= 50
    assert {span.value for span in found} == {0.0, 1.0, 2.0}


@pytest.mark.parametrize("count", [0, 1])
def test_too_little_to_draw_is_no_error(count: int) -> None:
    few = np.zeros(count)
    assert len(spans(ticks([0.0] * count), few)) == count
    assert at_ticks(ticks([0.0] * count), few)[0].size == count
    assert around((few, few), 0.0)[0].size == thinned((few, few))[0].size == count
    assert pieces(np.ones(count, np.bool_), few)[0].size == 0


def test_a_piece_goes_on_to_where_the_next_begins() -> None:
    way = np.arange(6.0)
    inside = np.array([True, True, False, True, False, True])
    east_m, north_m = pieces(inside, way, way + 10.0)
    np.testing.assert_array_equal(east_m, [0.0, 1.0, 2.0, np.nan, 3.0, 4.0, np.nan])
    np.testing.assert_array_equal(north_m, east_m + 10.0)
