"""Whatever the drivers hand out, no decision sees what cannot be, and silence is noticed (fault catalogue, fault 8)."""

from __future__ import annotations

from math import inf, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.detector.rover import FULL, PIVOT, TICK_S, Rover
from wayfarer.hal import STOP, CompassReading, ContactReading, MotionReading, Side, Snapshot, WheelReading
from wayfarer.safety.conditions import Condition

# A second of rubbish: what the sensors may take to be silent in is over by then.
NUMBERS = st.floats() | st.sampled_from([0.0, -0.0, 1.0, 179.9, 359.9, 360.0, nan, inf, -inf, 1e308])
TIMES = st.sampled_from([0.0, 0.0, 0.0, -TICK_S, TICK_S, 1e6, -1e6, inf, -inf, nan])  # as an offset to now
NO_TIMES = st.sampled_from([TICK_S, 1e6, inf, -inf, nan])
SIDES = st.lists(st.sampled_from(Side), max_size=2).map(tuple)
WHEELS = st.sampled_from([STOP, FULL, PIVOT])


def snapshots(times: st.SearchStrategy[float]) -> st.SearchStrategy[Snapshot]:
    """What the sensors say, their times still as offsets to that of the tick."""
    compass = st.builds(CompassReading, times, NUMBERS, NUMBERS, NUMBERS, st.none() | st.integers(-1, 4))
    motion = st.builds(MotionReading, times, NUMBERS, NUMBERS, NUMBERS, st.booleans())
    contact = st.builds(ContactReading, times, SIDES, st.none() | NUMBERS)
    wheels = st.builds(WheelReading, times, *(st.none() | NUMBERS for _ in range(4)))
    return st.builds(Snapshot, st.just(0.0), *(each | st.none() for each in (compass, motion, contact, wheels)))


def at(t_s: float, said: Snapshot) -> Snapshot:
    """The same snapshot at a time."""
    late = [None if each is None else each._replace(t_s=t_s + each.t_s) for each in said[1:]]
    return Snapshot(t_s, *late)  # type: ignore[arg-type]


@given(said=st.lists(st.tuples(snapshots(TIMES), WHEELS), max_size=20))
def test_no_rubbish_reaches_a_decision_and_none_outlives_a_second_of_silence(said: list[tuple]) -> None:  # type: ignore[type-arg]
    rover = Rover(calibration_min=2, watches_contact=True)
    detector = rover.detector
    for tick, (snapshot, wheels) in enumerate(said):
        t_s = tick * TICK_S
        rover.sees(at(t_s, snapshot), wheels)
        if (compass := detector.compass) is not None:
            assert compass.t_s <= t_s
            assert 0.0 <= compass.heading_deg < 360.0
            assert abs(compass.pitch_deg) <= 180.0 >= abs(compass.roll_deg)
        if (contact := detector.contact) is not None:
            assert contact.t_s <= t_s
            assert contact.obstacle_bearing_deg is None or 0.0 <= contact.obstacle_bearing_deg < 180.0
    after_s = len(said) * TICK_S
    for tick in range(round(1.0 / TICK_S) + 1):
        found = rover.sees(Snapshot(after_s + tick * TICK_S, None, None, None))
    silent = {Condition.COMPASS_STALE, Condition.MOTION_STALE, Condition.CONTACT_STALE}
    assert silent <= set(found.conditions)


@settings(max_examples=30)
@given(said=st.lists(snapshots(NO_TIMES), min_size=20, max_size=20))
def test_readings_of_no_time_or_of_the_future_are_silence(said: list[Snapshot]) -> None:
    rover = Rover(watches_contact=True)
    rover.contact = ContactReading(0.0, (), None)
    rover.tick()
    for snapshot in said:
        rover.t_s += TICK_S
        found = rover.sees(at(rover.t_s, snapshot), FULL)
    silent = {Condition.COMPASS_STALE, Condition.MOTION_STALE, Condition.CONTACT_STALE}
    assert silent <= set(found.conditions)
    assert found.anomalies == ()


def test_readings_of_which_the_time_goes_back_are_silence() -> None:
    rover = Rover(watches_contact=True)
    rover.tick()
    for tick in range(20):
        rover.t_s += TICK_S
        old_s = -tick * TICK_S
        said = Snapshot(
            rover.t_s,
            CompassReading(old_s, 0.0, 0.0, 0.0, 3),
            MotionReading(old_s, 0.0, 0.0, 1.0),
            ContactReading(old_s, (), None),
        )
        found = rover.sees(said)
    assert {Condition.COMPASS_STALE, Condition.MOTION_STALE, Condition.CONTACT_STALE} <= set(found.conditions)


def test_single_reading_that_is_older_than_the_last_is_not_believed() -> None:
    rover = Rover(watches_contact=True)
    for tick in (1, 2):
        compass = CompassReading(tick * TICK_S, float(tick), 0.0, 0.0, 3)
        touch = ContactReading(tick * TICK_S, (), None)
        rover.sees(Snapshot(tick * TICK_S, compass, None, touch))
    late = Snapshot(
        3 * TICK_S, CompassReading(TICK_S, 9.0, 0.0, 0.0, 3), None, ContactReading(TICK_S, (Side.LEFT,), None)
    )
    assert rover.sees(late).anomalies == ()
    assert rover.heading_deg == 2.0
    assert rover.detector.contact == touch


@pytest.mark.parametrize("quality", [nan, inf, 1.1, -0.1])
def test_motion_of_which_the_quality_cannot_be_is_no_evidence_of_a_stall(quality: float) -> None:
    rover = Rover()
    for _ in range(8):
        found = rover.tick(FULL, 0.0, quality=quality)
    assert found.anomalies == ()
    assert Condition.MOTION_IMPLAUSIBLE in found.conditions


@given(rubbish=snapshots(st.just(0.0)), ticks=st.integers(1, 3))
def test_sensors_that_recover_are_believed_again(rubbish: Snapshot, ticks: int) -> None:
    rover = Rover()
    rover.tick()
    for _ in range(ticks):
        rover.t_s += TICK_S
        rover.sees(at(rover.t_s, rubbish))
    for _ in range(40):
        last = rover.tick()
    assert last.conditions == ()
    assert rover.heading_deg == 0.0
