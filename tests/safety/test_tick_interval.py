"""The interval between two ticks: time in which no tick came is not driven."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.tick_interval import MOST_SHARE, IntervalTimer, Moved, TickInterval

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


# -- between two motion readings --------------------------------------------------------------------------------------

SPEED_M_S, TICK_S = 2.0, 0.125
BACK = WheelCommand(-0.5, -0.5)
PIVOT = WheelCommand(0.5, -0.5)


def driven(*ticks: WheelCommand, turned_deg: float = 0.0, before_m: float = 0.0) -> Moved:
    """What was commanded in these ticks, in which the body turned by so much."""
    timer, moved = IntervalTimer(LATE_S, SPEED_M_S), Moved(before_m)
    measured(timer, 0.0, STOP)
    for number, wheels in enumerate(ticks, 1):
        moved.drive(measured(timer, number * TICK_S, wheels), turned_deg / len(ticks), SPEED_M_S)
    return moved


def test_way_counts_both_directions_and_what_was_commanded_ahead_is_the_difference() -> None:
    moved = driven(AHEAD, AHEAD, BACK, PIVOT)
    assert (moved.commanded_m, moved.way_m) == (2 * 0.75 * 0.25 - 0.5 * 0.25, 2 * 0.75 * 0.25 + 0.5 * 0.25)
    assert moved.pushed_m == moved.way_m + 0.5 * 0.25
    assert not moved.known


def test_time_in_which_no_tick_came_is_not_driven() -> None:
    timer, moved = IntervalTimer(LATE_S, SPEED_M_S), Moved()
    for t_s in (0.0, 1.0):
        moved.drive(measured(timer, t_s, AHEAD), 0.0, SPEED_M_S)
    assert moved.undriven_s == 1.0 - LATE_S


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize(("wheels", "forward_m"), [(AHEAD, 0.1), (BACK, -0.1), (PIVOT, 0.1)])
def test_sensor_that_sees_no_direction_has_that_of_the_wheels(
    wheels: WheelCommand, forward_m: float, signed: bool
) -> None:
    moved = driven(wheels)
    moved.see(forward_m if signed else 0.1, 0.02, signed=signed)
    assert (moved.known, moved.signed, moved.forward_m, moved.right_m) == (True, signed, forward_m, 0.02)


@pytest.mark.parametrize(("before_m", "most_m"), [(0.0, 0.125), (0.1, 0.125), (0.3, 0.3)])
def test_reading_counts_for_little_more_than_the_way_of_its_interval_or_the_one_before(
    before_m: float, most_m: float
) -> None:
    assert driven(BACK, before_m=before_m).most_m == pytest.approx(MOST_SHARE * most_m)


@pytest.mark.parametrize(
    ("wheels", "forward_m", "counted_m"),
    [(AHEAD, 0.1, 0.1), (AHEAD, 9.0, MOST_SHARE * 0.1875), (BACK, 9.0, MOST_SHARE * 0.125), (PIVOT, 9.0, 9.0)],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_reading_counts_up_to_a_bound_if_anything_was_commanded(
    wheels: WheelCommand, forward_m: float, counted_m: float, sign: float
) -> None:
    moved = driven(wheels)
    moved.see(sign * forward_m, 0.0, signed=True)
    assert moved.forward_m == sign * forward_m
    assert moved.counted_m == pytest.approx(sign * counted_m)


@pytest.mark.parametrize(
    ("wheels", "turned_deg", "forward_m", "straight"),
    [
        (WheelCommand(0.5, 0.5), 0.0, 0.125, 1.0),
        (WheelCommand(0.5, 0.5), 0.0, 0.0, 1.0),  # a trunk holds it
        (WheelCommand(0.5, 0.0), 12.5, 0.0625, 0.5**0.5),  # it turns as far as the one side goes
        (WheelCommand(1.0, 0.0), 0.0, 0.125, 0.0),  # it does not follow: the sides slip against each other
        (STOP, 0.0, 0.0, 1.0),
    ],
)
def test_share_of_the_grip_that_is_left_for_driving(
    wheels: WheelCommand, turned_deg: float, forward_m: float, straight: float
) -> None:
    moved = driven(wheels, turned_deg=turned_deg)
    moved.see(forward_m, 0.0, signed=True)
    assert moved.straight(0.005) == pytest.approx(straight)
