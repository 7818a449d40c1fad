"""Dead reckoning over a log: where the rover went, by its motion sensor, its commands and its compass."""

from __future__ import annotations

from math import isnan, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.fieldlog.dead_reckoning import GAP_S, DeadReckoning
from wayfarer.hal import MotionReading

SPEED_M_S = 1.5
DT_S = 0.05


def motion(forward_m: float, right_m: float = 0.0, quality: float = 0.8, signed: bool = True) -> MotionReading:
    return MotionReading(0.0, forward_m, right_m, quality, signed)


def drive(*ticks: dict[str, Any], duty: float = 0.0, heading_deg: float | None = 0.0) -> DeadReckoning:
    """Feed ticks, a twentieth of a second apart unless they say when."""
    track = DeadReckoning(SPEED_M_S)
    for number, tick in enumerate(ticks):
        t_s, seen = tick.get("t_s", number * DT_S), tick.get("motion")
        track.take(t_s, heading_deg, 2.0 * duty, seen and seen._replace(t_s=t_s))
    return track


def at(track: DeadReckoning) -> tuple[float, float]:
    assert track.place is not None
    return track.place.north_m, track.place.east_m


@pytest.mark.parametrize(
    ("heading_deg", "north_m", "east_m"), [(0.0, 0.3, 0.1), (90.0, -0.1, 0.3), (180.0, -0.3, -0.1), (270.0, 0.1, -0.3)]
)
def test_forward_and_right_turn_with_the_compass(heading_deg: float, north_m: float, east_m: float) -> None:
    track = drive({"motion": motion(0.3, 0.1)}, heading_deg=heading_deg)
    assert at(track) == pytest.approx((north_m, east_m))
    assert track.path_m == pytest.approx(0.3)


def test_sensor_counts_and_not_the_wheels_while_it_can_tell() -> None:
    assert at(drive(*[{"motion": motion(0.0)}] * 10, duty=1.0)) == (0.0, 0.0)


@pytest.mark.parametrize("quality", [0.0, 0.19, nan])
def test_wheels_count_where_the_sensor_cannot_tell(quality: float) -> None:
    track = drive(*[{"motion": motion(0.0, quality=quality)}] * 11, duty=0.5)
    assert at(track)[0] == pytest.approx(10 * DT_S * 0.5 * SPEED_M_S)


@pytest.mark.parametrize("wrong", [motion(50.0), motion(0.0, 40.0), motion(-50.0), motion(1e308), motion(nan)])
def test_wheels_count_where_the_sensor_says_more_than_any_rover_can_do(wrong: MotionReading) -> None:
    track = drive(*[{"motion": motion(0.0)}] * 5, {"motion": wrong}, *[{"motion": motion(0.0)}] * 5, duty=0.5)
    assert at(track) == pytest.approx((DT_S * 0.5 * SPEED_M_S, 0.0))


def test_way_of_a_long_silence_is_believed_as_far_as_the_rover_can_have_gone() -> None:
    ticks: list[dict[str, Any]] = [{"motion": motion(0.0)}, {"t_s": 60.0, "motion": motion(80.0)}]
    assert at(drive(*ticks))[0] == pytest.approx(80.0)


def test_rover_without_a_motion_sensor_goes_by_its_wheels() -> None:
    assert at(drive(*[{}] * 11, duty=-1.0))[0] == pytest.approx(-10 * DT_S * SPEED_M_S)


def test_displacement_that_comes_with_every_second_tick_is_counted_once() -> None:
    assert at(drive(*[{"motion": motion(0.1)}, {}] * 5, duty=1.0))[0] == pytest.approx(0.5)


def test_sense_that_knows_no_direction_goes_the_way_of_the_wheels() -> None:
    assert at(drive({}, *[{"motion": motion(0.1, signed=False)}] * 4, duty=-0.5))[0] == pytest.approx(-0.4)


def test_nothing_is_made_up_for_an_hour_of_missing_records() -> None:
    track = drive({}, {"t_s": 3600.0}, {"t_s": 3600.0 + DT_S}, duty=1.0)
    assert at(track)[0] == pytest.approx(DT_S * SPEED_M_S)


def test_no_place_before_the_first_heading() -> None:
    assert drive({}, {}, heading_deg=None).place is None


def test_log_without_a_configuration_still_has_a_place() -> None:
    assert DeadReckoning().take(0.0, 5.0, 2.0, None) is not None


def test_measured_speed_holds_for_a_second_in_which_the_sensor_cannot_tell() -> None:
    track = drive({"motion": motion(0.1)}, {"motion": motion(0.1)}, {}, {"motion": motion(0.1, quality=0.0)})
    assert track.measured_m_s == pytest.approx(0.1 / DT_S)
    track.take(DT_S + GAP_S + 0.01, 0.0, 0.0, None)
    assert isnan(track.measured_m_s)


@given(st.lists(st.floats(0.0, 0.2), min_size=1, max_size=100), st.sampled_from([0.05, 0.1, 0.25]), st.floats(0.1, 2.0))
def test_speed_of_a_steady_rover_is_steady_however_the_ticks_jitter(
    late_s: list[float], every_s: float, speed_m_s: float
) -> None:
    """A tick that came late, and the next in time, had a rover of 1.4 m/s at 80 m/s."""
    track = DeadReckoning(SPEED_M_S)
    for number, tick_late_s in enumerate(late_s):
        read_t_s, before_s = number * every_s, max([0.0, *late_s[:number]])
        t_s = read_t_s + max(tick_late_s, before_s - every_s)
        track.take(t_s, 0.0, 1.0, motion(speed_m_s * every_s)._replace(t_s=read_t_s))
        assert isnan(track.measured_m_s) or track.measured_m_s == pytest.approx(speed_m_s)
    assert isnan(track.measured_m_s) is (len(late_s) == 1)


@pytest.mark.parametrize("t_s", [nan, 0.0, -1.0])
def test_reading_of_a_time_that_cannot_be_gives_no_speed(t_s: float) -> None:
    track = drive({"motion": motion(0.1)})
    track.take(DT_S, 0.0, 0.0, motion(0.1)._replace(t_s=t_s))
    assert isnan(track.measured_m_s)


def test_speed_is_measured_from_reading_to_reading_and_not_across_missing_records() -> None:
    track = drive({"motion": motion(0.1)}, {}, {"motion": motion(0.1)})
    assert track.measured_m_s == pytest.approx(0.1 / (2 * DT_S))
    track.interrupted()
    assert isnan(track.measured_m_s)
    for t_s, known in ((4 * DT_S, False), (5 * DT_S, True)):
        track.take(t_s, 0.0, 0.0, motion(0.1)._replace(t_s=t_s))
        assert isnan(track.measured_m_s) is not known
