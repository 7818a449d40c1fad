"""The odometer: ground that was seen to pass, and commanded ground where nothing is known."""

from __future__ import annotations

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.detector.motion import MOST_SHARE, Odometer
from wayfarer.hal import MotionReading, WheelCommand
from wayfarer.safety.tick_interval import TickInterval

TICK_S = 0.05


class Way:
    """Feeds an odometer: a tick of commanded metres, and in every second one what the sensor saw."""

    def __init__(self) -> None:
        self.odometer = Odometer(quality_min=0.2)
        self._t_s = 0.0

    def drive(self, ticks: int, told_m: float, seen_m: float | None, *, quality: float = 0.8) -> float:
        for tick in range(ticks):
            self._t_s += TICK_S
            interval = TickInterval(self._t_s, WheelCommand(0.5, 0.5), TICK_S, TICK_S, told_m)
            speaks = seen_m is not None and tick % 2 == 1
            self.odometer.update(interval, MotionReading(self._t_s, seen_m or 0.0, 0.0, quality) if speaks else None)
        return self.odometer.covered_m


def test_without_a_sensor_it_counts_what_is_commanded_both_ways() -> None:
    way = Way()
    way.drive(20, 0.05, None)
    assert way.drive(10, -0.05, None) == pytest.approx(1.5)


def test_step_back_is_negative_and_the_steps_add_up_to_what_was_covered() -> None:
    odometer = Odometer(quality_min=0.2)
    steps_m = []
    for tick in range(1, 41):
        told_m = 0.05 if tick <= 20 else -0.05
        interval = TickInterval(tick * TICK_S, WheelCommand(0.5, 0.5), TICK_S, TICK_S, told_m)
        steps_m.append(odometer.update(interval, MotionReading(tick * TICK_S, 0.4 * told_m, 0.0, 0.8))[0])
    assert all(step_m > 0.0 for step_m in steps_m[:20])
    assert all(step_m < 0.0 for step_m in steps_m[20:])
    assert sum(map(abs, steps_m)) == pytest.approx(odometer.covered_m) == pytest.approx(0.8)


def test_with_a_sensor_it_counts_what_was_seen() -> None:
    assert Way().drive(40, 0.05, 0.04) == pytest.approx(0.8)


def test_held_body_covers_nothing() -> None:
    way = Way()
    before_m = way.drive(20, 0.05, 0.1)
    assert way.drive(20, 0.05, 0.0) - before_m <= 0.05 + 1e-9, "the tick before the first reading that saw it stand"


def test_what_was_assumed_before_a_stall_is_not_subtracted_from_the_way_back() -> None:
    way = Way()
    way.drive(21, 0.05, 0.1)  # the last tick has no reading: it is assumed that the body went on
    stands_m = way.drive(7, 0.05, 0.0)
    assert way.drive(6, -0.03, -0.06) - stands_m == pytest.approx(0.18)


def test_between_readings_it_goes_on_at_the_share_that_was_seen() -> None:
    way = Way()
    way.drive(20, 0.05, 0.05)
    assert way.drive(1, 0.05, None) == pytest.approx(0.5 + 0.025)


@pytest.mark.parametrize("seen_m", [nan, inf, -inf, 1e9])
def test_garbage_counts_for_little_more_than_was_commanded(seen_m: float) -> None:
    assert Way().drive(20, 0.05, seen_m) == pytest.approx(1.0 * MOST_SHARE)


@pytest.mark.parametrize("quality", [0.0, 0.1, nan])
def test_reading_that_cannot_be_believed_counts_as_commanded(quality: float) -> None:
    assert Way().drive(20, 0.05, 0.0, quality=quality) == pytest.approx(1.0)


def test_turning_on_the_spot_covers_nothing() -> None:
    assert Way().drive(20, 0.0, 0.03) == 0.0


def test_displacement_has_all_that_was_seen_whatever_was_commanded() -> None:
    """A body on a slope slides back and aside while it turns; that is no ground that an algorithm covers."""
    odometer = Odometer(quality_min=0.2)
    steps_m = []
    for tick in range(1, 41):
        interval = TickInterval(tick * TICK_S, WheelCommand(0.5, 0.5), TICK_S, TICK_S, 0.05 if tick <= 20 else 0.0)
        seen = MotionReading(tick * TICK_S, 0.08 if tick <= 20 else -0.02, 0.01, 0.8)
        steps_m.append(odometer.update(interval, seen if tick % 2 == 0 else None))
    ahead_m, right_m = (sum(way) for way in zip(*steps_m, strict=True))
    assert (ahead_m, right_m) == pytest.approx((10 * 0.08 - 10 * 0.02, 20 * 0.01))
    assert odometer.covered_m == pytest.approx(0.8 + 0.02), "the first reading after a command is taken to be coasting"


@given(st.lists(st.tuples(st.floats(-0.2, 0.2), st.none() | st.floats(), st.floats(0.0, 1.0)), max_size=60))
def test_distance_never_shrinks_and_never_outgrows_the_commands(ticks: list[tuple[float, float | None, float]]) -> None:
    odometer, told_m, last_m = Odometer(0.2), 0.0, 0.0
    for tick, (forward_m, seen_m, quality) in enumerate(ticks):
        told_m += abs(forward_m)
        reading = None if seen_m is None else MotionReading(tick * TICK_S, seen_m, 0.0, quality)
        odometer.update(TickInterval(tick * TICK_S, WheelCommand(0.0, 0.0), TICK_S, TICK_S, forward_m), reading)
        assert last_m <= odometer.covered_m <= 2.0 * MOST_SHARE * told_m + 1e-9
        last_m = odometer.covered_m
