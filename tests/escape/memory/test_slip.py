"""Which stops are obstacles: what the nose says, and what a second try says."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from tests.escape.walk import STUCK, TICK_S, observation
from wayfarer.escape.api import Anomaly
from wayfarer.escape.memory.slip import NOSE_UP_DEG, PASSED_M, SAME_PLACE, UNMEASURED_M, SlipClassifier

WIDTH_M = 0.4
HERE = (5.0, 0.0)


@pytest.fixture
def slips() -> SlipClassifier:
    return SlipClassifier(WIDTH_M)


def stopped(slips: SlipClassifier, place: tuple[float, float], travelled_m: float = 5.0) -> bool:
    return slips.is_slip(observation(anomalies=STUCK, travelled_m=travelled_m, measured_m=4.0), place)


def stopped_after(pitches_deg: Iterable[float]) -> bool:
    """Whether a stop after these pitches, one a tick, may be a slip."""
    slips, seen = SlipClassifier(WIDTH_M), observation()
    for tick, pitch_deg in enumerate(pitches_deg):
        seen = observation(t_s=tick * TICK_S, pitch_deg=pitch_deg, anomalies=STUCK)
        slips.follow(seen)
    return slips.is_slip(seen, HERE)


@pytest.mark.parametrize("slope_deg", [-10.0, 0.0, 10.0])
def test_nose_that_rose_is_an_obstacle_on_any_slope(slope_deg: float) -> None:
    level = [slope_deg] * 40
    assert stopped_after(level)
    assert not stopped_after([*level, *[slope_deg + NOSE_UP_DEG + 0.5] * 6])
    assert stopped_after([*level, *[slope_deg + NOSE_UP_DEG - 0.5] * 6])
    assert stopped_after([*level, *[slope_deg] * 5, slope_deg + NOSE_UP_DEG + 2.0]), "a single reading is noise"


def test_stop_right_after_the_start_has_nothing_to_compare_the_nose_with(slips: SlipClassifier) -> None:
    slips.follow(observation(pitch_deg=20.0))
    assert stopped(slips, HERE)


def test_body_that_is_held_in_a_turn_did_not_slip(slips: SlipClassifier) -> None:
    assert not slips.is_slip(observation(), HERE)


@pytest.mark.parametrize("anomaly", [each for each in Anomaly if each is not Anomaly.IMMOBILISED])
def test_tilt_and_touch_are_no_slips(slips: SlipClassifier, anomaly: Anomaly) -> None:
    for anomalies in ((anomaly,), (Anomaly.IMMOBILISED, anomaly)):
        assert not slips.is_slip(observation(anomalies=anomalies), HERE)


def test_where_nothing_measures_distance_a_stall_soon_after_a_try_is_the_same(slips: SlipClassifier) -> None:
    """Such a rover seems to get on while it pushes, and would push at the same trunk for ever."""
    assert slips.is_slip(observation(anomalies=STUCK, travelled_m=5.0), HERE)
    soon = observation(anomalies=STUCK, travelled_m=5.0 + UNMEASURED_M)
    slips.follow(soon)
    assert not slips.is_slip(soon, (8.0, 0.0))
    later = observation(anomalies=STUCK, travelled_m=20.0)
    assert slips.is_slip(later, HERE)


@pytest.mark.parametrize("tick_s", [0.01, 0.05, 0.1])
def test_nose_is_compared_at_any_control_rate(slips: SlipClassifier, tick_s: float) -> None:
    for tick in range(round(2.0 / tick_s)):
        t_s = tick * tick_s
        slips.follow(observation(t_s=t_s, pitch_deg=5.0 if t_s > 1.7 else 0.0))
    assert slips.risen_deg(t_s) == pytest.approx(5.0)


def test_stopped_again_at_the_same_place_is_an_obstacle(slips: SlipClassifier) -> None:
    assert stopped(slips, HERE)
    assert not stopped(slips, (HERE[0] + SAME_PLACE * WIDTH_M - 0.01, 0.0))
    assert (slips.slips, slips.obstacles) == (0, 1)


def test_stopped_at_another_place_soon_after_says_nothing(slips: SlipClassifier) -> None:
    assert stopped(slips, HERE)
    assert stopped(slips, (HERE[0] + SAME_PLACE * WIDTH_M + 0.01, 0.0)), "it may have slid along a trunk"
    assert (slips.slips, slips.obstacles) == (0, 0)


def test_slip_is_over_once_it_is_driven_past(slips: SlipClassifier) -> None:
    assert stopped(slips, HERE, travelled_m=5.0)
    slips.follow(observation(travelled_m=5.0 + PASSED_M, measured_m=5.0))
    assert slips.slips == 0
    slips.follow(observation(travelled_m=5.1 + PASSED_M, measured_m=5.1))
    assert slips.slips == 1
    assert stopped(slips, HERE, travelled_m=9.0), "back at the place, it is another stop"


def test_wheels_that_spin_at_a_trunk_have_not_driven_past_it(slips: SlipClassifier) -> None:
    stop = observation(anomalies=STUCK, travelled_m=5.0, measured_m=5.0)
    assert slips.is_slip(stop, HERE)
    again = stop._replace(travelled_m=5.0 + 2.0 * PASSED_M, measured_m=5.1)
    slips.follow(again)
    assert not slips.is_slip(again, HERE)
    assert (slips.slips, slips.obstacles) == (0, 1)


def test_second_tries_stop_after_eight_that_all_met_something(slips: SlipClassifier) -> None:
    for met in range(9):
        place = (10.0 * met, 0.0)
        assert stopped(slips, place) == (met < 8 + 1)
        stopped(slips, place)
    assert not stopped(slips, (500.0, 0.0))
    slips.reset()
    assert stopped(slips, (500.0, 0.0)), "a new mission begins"


def test_slips_keep_the_second_tries(slips: SlipClassifier) -> None:
    for number in range(30):
        here_m = 10.0 * number
        slips.follow(observation(travelled_m=here_m, pitch_deg=number % 2 * 0.1))
        assert stopped(slips, (here_m, 0.0), travelled_m=here_m)
    assert slips.slips == 29


@pytest.mark.parametrize(("pitch_step_deg", "measured_share"), [(0.1, 1.0), (0.0, 0.5), (0.0, 1.0)])
def test_rover_without_tilt_and_motion_sensor_does_not_push_twice(
    slips: SlipClassifier, pitch_step_deg: float, measured_share: float
) -> None:
    """It would climb until it tips. Either of the two senses is enough for a second try."""
    for tick in range(20):
        driven_m = tick * TICK_S
        seen = observation(
            t_s=driven_m, pitch_deg=tick % 2 * pitch_step_deg, travelled_m=driven_m, anomalies=STUCK,
            measured_m=measured_share * driven_m,
        )  # fmt: skip
        slips.follow(seen)
    assert slips.is_slip(seen, HERE) is (pitch_step_deg > 0.0 or measured_share < 1.0)
