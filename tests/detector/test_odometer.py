"""The odometer: ground that was seen to pass, and commanded ground if nothing is known."""

from __future__ import annotations

from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.detector.rover import VEHICLE
from wayfarer.detector.motion import MotionMonitor
from wayfarer.detector.settings import DetectorSettings
from wayfarer.hal import MotionReading, WheelCommand
from wayfarer.safety.tick_interval import MOST_SHARE, TickInterval

TICK_S = 0.05
NOISE_M = 1e-9  # no sensor that sees ground that moves repeats a reading to the last digit


class Way:
    """Feeds an odometer: ticks of commanded metres, and what the sensor saw."""

    def __init__(self) -> None:
        self.motion = MotionMonitor(DetectorSettings(), VEHICLE, watched=True)
        self.odometer = self.motion.odometer
        self._ticks = 0

    def tick(
        self, told_m: float, seen_m: float | None, right_m: float = 0.0, quality: float = 0.8
    ) -> tuple[float, float]:
        """Drive one tick; return the displacement, ahead and to the right."""
        self._ticks += 1
        t_s = self._ticks * TICK_S
        right_m += NOISE_M * (self._ticks // 2 % 2)
        reading = None if seen_m is None else MotionReading(t_s, seen_m, right_m, quality)
        self.motion.update(TickInterval(t_s, WheelCommand(0.5, 0.5), TICK_S, TICK_S, told_m), 0.0, reading, [])
        return self.odometer.ahead_m, self.odometer.right_m

    def drive(self, ticks: int, told_m: float, seen_m: float | None, *, quality: float = 0.8) -> float:
        """Drive; the sensor speaks in every second tick. Return what is covered."""
        for tick in range(ticks):
            self.tick(told_m, seen_m if tick % 2 == 1 else None, quality=quality)
        return self.odometer.covered_m


def test_without_a_sensor_it_counts_what_is_commanded_both_ways() -> None:
    way = Way()
    way.drive(20, 0.05, None)
    assert way.drive(10, -0.05, None) == pytest.approx(1.5)


def test_step_back_is_negative_and_the_steps_add_up_to_what_was_covered() -> None:
    way = Way()
    steps_m = [way.tick(told_m, 0.4 * told_m)[0] for told_m in 20 * [0.05] + 20 * [-0.05]]
    assert all(step_m > 0.0 for step_m in steps_m[:20])
    assert all(step_m < 0.0 for step_m in steps_m[20:])
    assert sum(map(abs, steps_m)) == pytest.approx(way.odometer.covered_m) == pytest.approx(0.8)


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


def test_what_was_assumed_before_a_stall_is_subtracted_from_the_same_way() -> None:
    """It stood in two ticks without a reading, for which 0.1 m were assumed."""
    way = Way()
    before_m = way.drive(20, 0.05, 0.1)
    for _ in range(2):
        way.tick(0.05, None)
    assumed_m = way.odometer.covered_m
    assert assumed_m - before_m == pytest.approx(0.1)
    way.tick(0.05, 0.0)
    assert way.drive(2, 0.05, 0.1) - before_m == pytest.approx(0.1)
    assert way.drive(2, 0.05, 0.1) - before_m == pytest.approx(0.2)


def test_between_readings_it_goes_on_at_the_share_that_was_seen() -> None:
    way = Way()
    way.drive(20, 0.05, 0.05)
    assert way.drive(1, 0.05, None) == pytest.approx(0.5 + 0.025)


@pytest.mark.parametrize("seen_m", [0.3, -0.3])
def test_wild_reading_counts_for_little_more_than_was_commanded(seen_m: float) -> None:
    assert Way().drive(20, 0.05, seen_m) == pytest.approx(1.0 * MOST_SHARE)


@pytest.mark.parametrize("seen_m", [nan, inf, -inf, 1e9])
def test_impossible_reading_counts_as_commanded(seen_m: float) -> None:
    assert Way().drive(20, 0.05, seen_m) == pytest.approx(1.0)


@pytest.mark.parametrize("quality", [0.0, 0.1, nan])
def test_reading_that_cannot_be_believed_counts_as_commanded(quality: float) -> None:
    assert Way().drive(20, 0.05, 0.0, quality=quality) == pytest.approx(1.0)


def test_turning_on_the_spot_covers_nothing() -> None:
    assert Way().drive(20, 0.0, 0.03) == 0.0


def test_displacement_has_all_that_was_seen_whatever_was_commanded() -> None:
    """A body on a slope slides back and aside while it turns; that is no ground that an algorithm covers."""
    way = Way()
    steps_m = []
    for tick in range(1, 41):
        told_m, seen_m = (0.05, 0.08) if tick <= 20 else (0.0, -0.02)
        steps_m.append(way.tick(told_m, seen_m if tick % 2 == 0 else None, 0.01))
    ahead_m, right_m = (sum(steps) for steps in zip(*steps_m, strict=True))
    assert (ahead_m, right_m) == pytest.approx((10 * 0.08 - 10 * 0.02, 20 * 0.01))
    assert way.odometer.covered_m == pytest.approx(0.8 + 0.02), (
        "the first reading after a command is taken to be coasting"
    )


@given(st.lists(st.tuples(st.floats(-0.2, 0.2), st.none() | st.floats(), st.floats(0.0, 1.0)), max_size=60))
def test_distance_never_shrinks_and_never_outgrows_the_commands(ticks: list[tuple[float, float | None, float]]) -> None:
    way, told_m, last_m = Way(), 0.0, 0.0
    for forward_m, seen_m, quality in ticks:
        told_m += abs(forward_m)
        way.tick(forward_m, seen_m, quality=quality)
        assert last_m <= way.odometer.covered_m <= 2.0 * MOST_SHARE * told_m + 1e-9
        last_m = way.odometer.covered_m
