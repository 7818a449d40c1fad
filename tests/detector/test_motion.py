"""The motion sensor: silent, blind, gone, impossible."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import cycle, repeat
from math import inf, nan
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.detector.rover import ALL_WELL, BACK, FULL, MAX_SPEED_M_S, PIVOT, SETTINGS, STEP_M, TICK_S, Rover, started
from wayfarer.detector.detector import DetectorTick
from wayfarer.escape.api import Anomaly
from wayfarer.hal import STOP, CompassReading, MotionReading, Snapshot, WheelCommand
from wayfarer.safety.conditions import Condition

CREEP = WheelCommand(0.3, 0.3)


def test_silent_motion_sensor_is_stale_and_no_stall_is_claimed() -> None:
    rover = started()
    assert rover.drive(8)[-1]
    found = [rover.tick(FULL, moved_m=None) for _ in range(12)]
    assert [detection.conditions for detection in found[:8]] == [()] * 8
    assert {detection.conditions for detection in found[8:]} == {(Condition.MOTION_STALE,)}
    assert found[-1].anomalies == ()
    assert rover.tick().conditions == ()


@pytest.mark.parametrize("silent_ticks", [9, 16, 200])
def test_sensor_that_begins_again_after_a_silence_does_not_call_a_rover_stuck_that_drives(silent_ticks: int) -> None:
    """Its first reading has the way since it was opened again, not all that was commanded in the silence."""
    rover = started()
    rover.drive(8, moved_m=STEP_M)
    rover.drive(silent_ticks, moved_m=None)
    assert rover.drive(8, moved_m=STEP_M) == [False] * 8


@pytest.mark.parametrize("gap_s", [0.3, 1.5, 3.0, 20.0, 60.0])
@pytest.mark.parametrize("stood_after_s", [0.2, 0.25, 0.3])
def test_rover_that_the_deadman_stopped_in_a_gap_without_ticks_is_not_immobilised(
    gap_s: float, stood_after_s: float
) -> None:
    rover = started()
    rover.drive(8, moved_m=STEP_M)
    late = rover.tick(FULL, moved_m=MAX_SPEED_M_S * stood_after_s, dt_s=gap_s)
    assert late.anomalies == ()
    assert rover.drive(4, STOP) == [False] * 4
    assert rover.drive(4, moved_m=STEP_M) == [False] * 4


def test_rover_that_had_just_begun_to_drive_when_the_ticks_stopped_is_not_immobilised() -> None:
    """It covered little before the deadman stopped it, and was driven for less than the window."""
    rover = started()
    rover.tick(STOP)
    assert rover.tick(FULL, moved_m=0.03, dt_s=0.5).anomalies == ()


@pytest.mark.parametrize("gap_s", [0.3, 1.5, 60.0])
def test_reading_from_before_a_gap_is_no_evidence_of_a_stall(gap_s: float) -> None:
    """The sensor was read just before the loop stood still; the tick came afterwards, the next reading later still."""
    rover = started()
    rover.drive(8, moved_m=STEP_M)
    read_t_s = rover.t_s + TICK_S
    rover.t_s += gap_s
    compass = CompassReading(rover.t_s, 0.0, 0.0, 0.0, None)
    late = rover.sees(Snapshot(rover.t_s, compass, MotionReading(read_t_s, STEP_M, 0.0, 0.8), None), FULL)
    assert late.anomalies == ()
    assert rover.tick(STOP, moved_m=0.25 * MAX_SPEED_M_S).anomalies == ()
    assert rover.drive(4, STOP) == [False] * 4
    assert rover.drive(4, moved_m=STEP_M) == [False] * 4


def test_poor_motion_is_unknown_for_as_long_as_it_is_poor() -> None:
    rover = started()
    found = [rover.tick(quality=0.0).conditions for _ in range(170)]
    assert found[:14] == [()] * 14
    assert set(found[14:]) == {(Condition.MOTION_UNKNOWN,)}
    assert rover.tick() == ALL_WELL


def test_rover_without_motion_sensor_does_not_miss_it() -> None:
    rover = started(watches_motion=False)
    assert {rover.tick(FULL, moved_m=None) for _ in range(100)} == {ALL_WELL}


@pytest.mark.parametrize(("speed_m_s", "implausible"), [(4.9, False), (5.1, True), (-5.1, True)])
def test_impossible_speed_is_implausible(speed_m_s: float, implausible: bool) -> None:
    conditions = started().tick(moved_m=speed_m_s * TICK_S).conditions
    assert (Condition.MOTION_IMPLAUSIBLE in conditions) is implausible


@pytest.mark.parametrize(("forward_m", "quality"), [(5.1 * TICK_S, 0.8), (nan, 0.8), (0.0, 1.5)])
def test_nobody_is_given_an_impossible_reading_to_believe(forward_m: float, quality: float) -> None:
    rover = started()
    rover.tick(FULL, forward_m, quality=quality)
    assert (moved := rover.detector.moved) is not None
    assert (moved.known, moved.forward_m, moved.right_m) == (False, 0.0, 0.0)


@pytest.mark.parametrize("late_s", [1.0, -0.5, nan])
def test_reading_of_an_impossible_time_is_given_to_nobody(late_s: float) -> None:
    """One such reading of 300 m ended a mission at its radius."""
    rover = started()
    rover.tick(FULL, STEP_M)
    t_s = rover.t_s + TICK_S
    rover.sees(Snapshot(t_s, rover.compass, MotionReading(t_s + late_s, 300.0, 0.0, 0.8), None), FULL)
    assert rover.detector.moved is None


def test_impossible_speed_is_no_evidence_of_motion() -> None:
    rover = started()
    rover.drive(4)
    assert Anomaly.IMMOBILISED in rover.tick(FULL, moved_m=9.0).anomalies
    assert rover.drive(4) == [True] * 4


def test_first_reading_of_a_run_is_not_called_implausible() -> None:
    """It comes at the very time at which the run begins, with a count of noise."""
    rover = Rover()
    compass = CompassReading(0.0, 0.0, 0.0, 0.0, None)
    rover.sees(Snapshot(0.0, None, None, None))
    detection = rover.sees(Snapshot(TICK_S, compass, MotionReading(0.0, 0.0004, 0.0002, 0.8), None))
    assert Condition.MOTION_IMPLAUSIBLE not in detection.conditions


def test_motion_sensor_that_is_silent_is_not_taken_for_one_that_sees_nothing() -> None:
    rover = started()
    found = [rover.tick(moved_m=None).conditions for _ in range(170)]
    assert not any(found[:6])
    assert set(found[8:]) == {(Condition.MOTION_STALE,)}
    assert rover.tick() == ALL_WELL


def sideways(rover: Rover, right_m: float) -> bool:
    """One tick at full duty in which nothing moves ahead; return whether the rover is called immobilised."""
    rover.t_s += TICK_S
    motion = MotionReading(rover.t_s, 0.0, right_m, 1.0)
    return Anomaly.IMMOBILISED in rover.sees(Snapshot(rover.t_s, rover.detector.compass, motion, None), FULL).anomalies


@pytest.mark.parametrize("every", [1, 3, 6])
def test_rubbish_sideways_hides_a_stall_for_two_seconds_at_most(every: int) -> None:
    """A sensor that says "sideways" of a rover that stands is believed, for it may skate; but not for long."""
    rover = started()
    rover.drive(8, moved_m=STEP_M)
    found = [sideways(rover, 4.9 * TICK_S if n % every == 0 else 0.0) for n in range(48)]
    assert all(found[round(SETTINGS.nowhere_s / TICK_S) :])
    assert not all(found)


@given(
    legs=st.lists(st.tuples(st.sampled_from([FULL, BACK, PIVOT, CREEP, STOP]), st.integers(2, 12)), max_size=6),
    share=st.floats(0.2, 1.0),
    pitch_deg=st.sampled_from([-10.0, 0.0, 10.0]),
)
def test_sensor_that_sees_no_direction_says_the_same_as_one_that_does(
    legs: list[tuple[WheelCommand, int]], share: float, pitch_deg: float
) -> None:
    """For all who use it: backing off uphill taught it that the slope takes up no duty."""
    rovers = {signed: started() for signed in (True, False)}
    for rover in rovers.values():
        rover.tick(pitch_deg=pitch_deg)
        rover.detector.begin_mission(DetectorTick(rover.t_s))
    for wheels, ticks in legs:
        ahead_m = share * (wheels.left + wheels.right) / 2.0 * STEP_M
        for _ in range(ticks):
            found = {
                signed: (
                    rover.tick(wheels, ahead_m if signed else abs(ahead_m), signed=signed, pitch_deg=pitch_deg),
                    rover.detector.moved and rover.detector.moved.forward_m,
                    rover.detector.grade.compensate(CREEP),
                )
                for signed, rover in rovers.items()
            }
            assert found[True] == found[False]


# -- without sight ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("blind", [{"quality": 0.0}, {"moved_m": None}], ids=["poor", "silent"])
def test_stride_without_sight_ends_after_its_length_as_if_the_rover_were_stuck(blind: dict[str, Any]) -> None:
    rover = started()
    stuck = rover.drive(200, **blind)
    first, *later = (n for n, each in enumerate(stuck) if each)
    stride = round(SETTINGS.blind_stride_m / STEP_M)
    assert first == pytest.approx(stride, abs=10)  # it begins when the sensor counts as blind
    assert later == list(range(first + stride, 200, stride))


def test_stride_begins_again_when_the_ground_was_seen() -> None:
    rover = started()
    for _ in range(4):
        assert rover.drive(40, quality=0.0) == [False] * 40
        assert rover.tick(FULL, moved_m=STEP_M) == ALL_WELL


def test_sure_zeros_now_and_then_do_not_begin_a_stride_again() -> None:
    rover = started()
    stuck = [rover.drive(1, quality=0.1 if n % 30 else 1.0)[0] for n in range(60)]
    assert any(stuck)


# -- readings that lie ------------------------------------------------------------------------------------------------


def stuck_after(rover: Rover, readings_m: Iterator[tuple[float, float]]) -> float:
    """Drive ahead with such readings, forward and right, until the rover counts as stuck; return after how long."""
    for n, (forward_m, right_m) in zip(range(400), readings_m, strict=False):
        t_s = rover.t_s = rover.t_s + TICK_S
        motion = MotionReading(t_s, forward_m, right_m, 1.0)
        compass = CompassReading(t_s, 0.0, 0.0, 0.0, None)
        if Anomaly.IMMOBILISED in rover.sees(Snapshot(t_s, compass, motion, None), FULL).anomalies:
            return (n + 1) * TICK_S
    return inf


@pytest.mark.parametrize(
    "readings_m",
    [
        repeat((0.6 * STEP_M, 0.0003)),
        cycle([(0.0, 0.0), (0.6 * STEP_M, 0.0)]),
        cycle([(0.0, 0.0001), (0.0001, 0.0), (1.7 * STEP_M, 0.0)]),
    ],
    ids=["repeats to the last digit", "garbage in every second reading", "garbage in every third"],
)
def test_readings_that_no_driven_body_gives_are_doubted(readings_m: Iterator[tuple[float, float]]) -> None:
    assert stuck_after(started(), readings_m) <= 5.0


def test_body_that_stops_twice_at_something_is_believed() -> None:
    rover = started()
    for _ in range(2):
        rover.drive(20, moved_m=STEP_M)
        rover.drive(3)
    rover.drive(3, moved_m=STEP_M)
    assert rover.detector.moved is not None
    assert rover.detector.moved.known


def test_wheels_that_stand_begin_no_doubt_of_equal_readings() -> None:
    """A rover that moves while it is commanded to stand is running away."""
    rover = started()
    found: set[Condition] = set()
    for _ in range(40):
        t_s = rover.t_s = rover.t_s + TICK_S
        compass = CompassReading(t_s, 0.0, 0.0, 0.0, None)
        found.update(rover.sees(Snapshot(t_s, compass, MotionReading(t_s, 0.02, 0.0, 1.0), None)).conditions)
    assert found == {Condition.RUNAWAY}


def test_rover_without_motion_sensor_has_no_strides() -> None:
    assert started(watches_motion=False).drive(400, moved_m=None) == [False] * 400


# -- zeros that are not believed --------------------------------------------------------------------------------------


def turned(rover: Rover, by_deg: float, ticks: int = 8) -> None:
    """Turn on the spot while the sensor says zero."""
    for n in range(ticks):
        rover.tick(PIVOT, moved_m=0.0, heading_deg=by_deg * (n + 1) / ticks)


def zeros_both_ways(rover: Rover) -> None:
    """Ten ticks ahead and ten back, of which the sensor shows nothing."""
    rover.drive(10)
    rover.drive(10, BACK)


def test_zeros_are_doubted_once_a_rover_that_they_call_stuck_both_ways_has_turned_on_the_spot() -> None:
    rover = started()
    zeros_both_ways(rover)
    turned(rover, 30.0)
    assert rover.drive(20, heading_deg=30.0) == [False] * 20
    assert Condition.MOTION_UNKNOWN in rover.tick(FULL, heading_deg=30.0).conditions
    assert rover.detector.moved is not None
    assert not rover.detector.moved.known


def test_zeros_of_a_rover_that_cannot_turn_are_believed() -> None:
    rover = started()
    zeros_both_ways(rover)
    turned(rover, 5.0)
    assert rover.drive(20, heading_deg=5.0)[-1]


def test_zeros_are_believed_where_the_rover_was_driven_one_way_only() -> None:
    rover = started()
    rover.drive(10)
    turned(rover, 30.0)
    assert rover.drive(20, heading_deg=30.0)[-1]


def test_sight_that_comes_back_ends_the_doubt() -> None:
    rover = started()
    zeros_both_ways(rover)
    turned(rover, 30.0)
    rover.drive(20, heading_deg=30.0)
    rover.drive(10, moved_m=STEP_M, heading_deg=30.0)
    assert rover.tick(FULL, moved_m=STEP_M, heading_deg=30.0) == ALL_WELL
    assert rover.drive(12, heading_deg=30.0)[-1]
