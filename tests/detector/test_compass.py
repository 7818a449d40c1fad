"""Whether the compass can be believed: its age, its jumps, its calibration, and one that is frozen."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.detector.rover import ALL_WELL, PIVOT, SETTINGS, TICK_S, VEHICLE, Rover, started
from wayfarer.angles import wrap180
from wayfarer.detector.compass import REPEATS_S
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import Condition


def test_compass_goes_stale_and_then_lost_and_comes_back() -> None:
    rover = started()
    found = [rover.tick(compass=False).conditions for _ in range(90)]
    assert found[:4] == [()] * 4
    assert set(found[4:80]) == {(Condition.COMPASS_STALE,)}
    assert set(found[80:]) == {(Condition.COMPASS_LOST,)}
    assert rover.tick() == ALL_WELL


def test_compass_that_never_spoke_is_stale_from_the_start() -> None:
    rover = Rover()
    assert rover.tick(compass=False).conditions == (Condition.COMPASS_STALE,)
    assert [rover.tick(compass=False) for _ in range(81)][-1].conditions == (Condition.COMPASS_LOST,)


SLOW_TO_TURN = replace(SETTINGS, heading_rate_max_deg_s=30.0)


def test_heading_that_insists_is_believed_after_a_stop() -> None:
    rover = started(SLOW_TO_TURN)
    found = rover.headings(*[180.0] * 16)
    assert found[:4] == [()] * 4
    assert found[4:8] == [(Condition.COMPASS_IMPLAUSIBLE, Condition.COMPASS_STALE)] * 4, "a rejected reading is none"
    assert found[8:14] == [(Condition.COMPASS_IMPLAUSIBLE,)] * 6, "believed, and of the last ten so many were not"
    assert found[14:] == [()] * 2
    assert rover.heading_deg == 180.0


def test_impossible_readings_must_insist_without_a_gap() -> None:
    rover = started(SLOW_TO_TURN)
    for n in range(60):
        good_deg = float(n // 4 % 2)
        rover.tick(heading_deg=180.0 if n % 4 else good_deg)
        assert rover.heading_deg == good_deg


def test_heading_may_go_further_after_a_gap() -> None:
    rover = started()
    rover.tick(compass=False)
    rover.tick(compass=False)
    assert rover.tick(heading_deg=65.0) == ALL_WELL
    assert rover.heading_deg == 65.0


def test_four_of_ten_rejected_readings_are_not_enough() -> None:
    rover = started()
    assert set(rover.headings(*[180.0, 0.0, 180.0, 0.0, 0.0] * 10)) == {()}


HEADINGS = st.lists(st.floats(0.0, 359.9) | st.sampled_from([0.0, 44.0, 46.0, 180.0, nan, inf, -1.0]), max_size=60)


@given(headings_deg=HEADINGS)
def test_no_jump_is_believed_without_a_stop_and_no_compass_that_is_half_wrong_drives(headings_deg: list[float]) -> None:
    rover, rejected = started(), [False] * 10
    for heading_deg in headings_deg:
        before_deg = rover.heading_deg
        conditions = rover.tick(heading_deg=heading_deg, dt_s=0.05).conditions
        jumped = not abs(wrap180(heading_deg - before_deg)) <= 45.0  # NaN jumps
        stopped = Condition.COMPASS_IMPLAUSIBLE in conditions
        rejected.append(jumped or not 0.0 <= heading_deg < 360.0)
        assert 0.0 <= rover.heading_deg < 360.0
        assert rover.heading_deg in (before_deg, heading_deg)
        if rejected[-1]:
            assert stopped or rover.heading_deg == before_deg
        else:
            assert rover.heading_deg == heading_deg
        if sum(rejected[-10:]) >= 5:
            assert stopped


@pytest.mark.parametrize(
    "wrong", [{"heading_deg": 360.0}, {"pitch_deg": nan}, {"pitch_deg": -1e9}, {"roll_deg": inf}, {"calibration": 4}]
)
def test_reading_that_no_compass_can_give_is_never_believed(wrong: dict[str, Any]) -> None:
    rover = Rover(watches_motion=False)
    found = [rover.tick(**wrong).conditions for _ in range(100)]
    assert rover.detector.compass is None
    assert found[-1] == (Condition.COMPASS_IMPLAUSIBLE, Condition.COMPASS_LOST)


# -- frozen ------------------------------------------------------------------------------------------------------

SLOW_TURN = WheelCommand(0.05, -0.05)  # 11 degrees per second
STRAIGHT = WheelCommand(0.5, 0.5)


def test_heading_that_stays_to_the_last_digit_through_a_second_of_commanded_turn_is_frozen() -> None:
    rover = started()
    found = [rover.tick(PIVOT, heading_deg=7.7).conditions for _ in range(20)]
    assert found[:16] == [()] * 16, "0.94 s: the first of these readings was a new one"
    assert set(found[16:]) == {(Condition.COMPASS_FROZEN,)}


def test_frozen_compass_stays_suspect_while_the_wheels_are_held_and_clears_when_its_value_moves() -> None:
    rover = started()
    for _ in range(20):
        rover.tick(PIVOT)
    assert set(rover.headings(*[0.0] * 200)) == {(Condition.COMPASS_FROZEN,)}
    assert rover.headings(0.1, 0.1) == [(), ()]
    assert {rover.tick(PIVOT, heading_deg=0.1) for _ in range(10)} == {ALL_WELL}, "it must freeze again"


def test_commanded_turns_add_up_until_a_compass_is_frozen() -> None:
    rover = started()
    found = []
    for _ in range(6):
        found += [rover.tick(PIVOT).conditions for _ in range(4)]
        found += [rover.tick(WheelCommand(0.5, 0.5), 0.03).conditions for _ in range(10)]
    assert found[0] == ()
    assert found[-1] == (Condition.COMPASS_FROZEN,)


@pytest.mark.parametrize(
    ("wheels", "jitters"),
    [(wheels, None) for wheels in (STOP, SLOW_TURN)]
    + [(wheels, axis) for wheels in (PIVOT, STRAIGHT) for axis in ("heading_deg", "pitch_deg", "roll_deg")],
)
def test_heading_that_need_not_change_or_of_which_the_part_shows_life_is_not_frozen(
    wheels: WheelCommand, jitters: str | None
) -> None:
    """The ground holds a pivot, and wheels that push shake the body by the last digit of an angle."""
    rover = started()
    for n in range(100):
        shaken: dict[str, Any] = {jitters: n % 2 / 10} if jitters else {}
        assert rover.tick(wheels, max(wheels.right, 0.0) * TICK_S, **shaken).conditions == ()


@pytest.mark.parametrize("wheels", [STRAIGHT, WheelCommand(0.55, 0.5), WheelCommand(-0.5, -0.5)])
def test_compass_that_repeats_all_values_for_seconds_of_driving_is_frozen_though_no_turn_is_commanded(
    wheels: WheelCommand,
) -> None:
    """It was found only once the heading that did not change had led the rover round: after 20 s, and a circle."""
    rover, moved_m = started(), (wheels.left + wheels.right) / 2.0 * TICK_S
    rover.tick(wheels, moved_m, heading_deg=7.6, pitch_deg=1.0)
    for n in range(1, 400):
        found = rover.tick(wheels, moved_m, heading_deg=7.7, pitch_deg=1.0).conditions
        assert (Condition.COMPASS_FROZEN in found) is (n * TICK_S > REPEATS_S + TICK_S / 2.0)
    assert rover.tick(wheels, moved_m, heading_deg=7.7, pitch_deg=1.1).conditions == ()


@pytest.mark.parametrize("step_deg", [0.25, 0.5, 1.0, 360.0 / 256.0])
def test_compass_of_coarse_steps_may_repeat_all_values_on_a_smooth_floor(step_deg: float) -> None:
    rover = started()
    for n in range(400):
        heading_deg, pitch_deg = (float(n < 50) * n % 3 * step_deg, float(n < 50) * n % 2)
        found = rover.tick(STRAIGHT, 0.5 * TICK_S, heading_deg=heading_deg, pitch_deg=pitch_deg).conditions
        assert Condition.COMPASS_FROZEN not in found


@pytest.mark.parametrize("moved_m", [0.0, None])
def test_compass_that_repeats_all_values_of_a_body_that_is_not_seen_to_move_is_not_frozen(
    moved_m: float | None,
) -> None:
    rover = started()
    assert not any(Condition.COMPASS_FROZEN in rover.tick(STRAIGHT, moved_m).conditions for _ in range(400))


@pytest.mark.parametrize(("max_speed_m_s", "frozen"), [(0.5, False), (2.0, True)])
def test_how_fast_a_turn_was_commanded_depends_on_the_speed_of_the_wheels(max_speed_m_s: float, frozen: bool) -> None:
    """Frozen counts from 20 degrees per second: the same duties turn the one by 11, the other by 46."""
    rover = Rover(vehicle=replace(VEHICLE, max_speed_m_s=max_speed_m_s))
    found = [rover.tick(WheelCommand(0.1, -0.1), heading_deg=7.7).conditions for _ in range(20)]
    assert (found[-1] == (Condition.COMPASS_FROZEN,)) is frozen


def test_heading_that_stays_through_a_turn_on_the_move_is_frozen_whatever_the_other_angles_do() -> None:
    rover, curve = started(), WheelCommand(0.8, 0.2)
    found = [rover.tick(curve, 0.5 * TICK_S, heading_deg=7.7, pitch_deg=n % 2 / 10).conditions for n in range(20)]
    assert found[-1] == (Condition.COMPASS_FROZEN,)


# -- calibration -------------------------------------------------------------------------------------------------


def test_calibration_that_drops_below_what_arming_demanded_is_told_after_a_second() -> None:
    rover = started(calibration_min=2)
    found = rover.headings(*[0.0] * 24, calibration=1)
    assert found[:15] == [()] * 15
    assert set(found[15:]) == {(Condition.COMPASS_UNCALIBRATED,)}
    assert rover.headings(0.0, calibration=2) == [()]


@pytest.mark.parametrize("calibrations", [[2], [3], [None], [3, *[0] * 9]], ids=str)
def test_calibration_that_is_good_enough_or_not_told_or_low_with_gaps_is_no_condition(calibrations: list[Any]) -> None:
    rover = started(calibration_min=2)
    assert {rover.tick(calibration=each).conditions for each in calibrations * 40} == {()}


def test_jump_of_a_compass_that_lost_its_calibration_stops_the_rover_for_a_second() -> None:
    rover = started(calibration_min=2)
    rover.headings(*[0.0] * 20, calibration=0)
    both = (Condition.COMPASS_IMPLAUSIBLE, Condition.COMPASS_UNCALIBRATED)
    assert rover.headings(120.0, calibration=0) == [both]
    found = rover.headings(*[0.0] * 20, calibration=0)
    assert set(found[:14]) == {both}
    assert set(found[14:]) == {(Condition.COMPASS_UNCALIBRATED,)}


@pytest.mark.parametrize("step_deg", [0.1, 5.0], ids=["dither", "toggles between two values"])
def test_heading_that_changes_by_dither_or_toggles_through_a_turn_on_the_move_is_frozen(step_deg: float) -> None:
    rover, curve = started(), WheelCommand(0.8, 0.2)
    for n in range(30):
        found = rover.tick(curve, 0.5 * TICK_S, heading_deg=7.7 + step_deg * (n % 2), pitch_deg=n % 3 / 10).conditions
    assert Condition.COMPASS_FROZEN in found
