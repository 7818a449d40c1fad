"""The interval between two ticks: time in which no tick came is not driven."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.tick_interval import IntervalTimer, TickInterval

LATE_S = 0.2
AHEAD = WheelCommand(0.5, 1.0)


def measured(timer: IntervalTimer, t_s: float, told: WheelCommand) -> TickInterval:
    """The interval that ends at this time."""
    interval = TickInterval(t_s, told)
    timer.measure(interval)
    return interval


def test_first_interval_has_no_length() -> None:
    first = measured(IntervalTimer(LATE_S, 2.0), 7.0, AHEAD)
    assert (first.dt_s, first.driven_s, first.forward_m) == (0.0, 0.0, 0.0)


def test_interval_is_the_time_since_the_last_tick_and_how_far_both_sides_were_told_to_go() -> None:
    timer = IntervalTimer(LATE_S, max_speed_m_s=2.0)
    measured(timer, 7.0, STOP)
    interval = measured(timer, 7.125, AHEAD)
    assert (interval.dt_s, interval.driven_s, interval.forward_m) == (0.125, 0.125, 0.75 * 2.0 * 0.125)
    assert measured(timer, 7.25, WheelCommand(-1.0, -1.0)).forward_m == -2.0 * 0.125


@given(st.lists(st.floats(0.0, 100.0), min_size=1))
def test_late_interval_counts_as_driven_for_as_long_as_a_tick_may_take(gaps_s: list[float]) -> None:
    timer, t_s = IntervalTimer(LATE_S, 1.0), 0.0
    measured(timer, t_s, AHEAD)
    for gap_s in gaps_s:
        t_s += gap_s
        interval = measured(timer, t_s, AHEAD)
        assert interval.dt_s == pytest.approx(gap_s, abs=1e-9)
        assert interval.driven_s == min(interval.dt_s, LATE_S)
        assert interval.forward_m == pytest.approx(0.75 * interval.driven_s)
