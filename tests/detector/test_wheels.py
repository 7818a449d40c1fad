"""The wheels' own sensor: silence."""

from __future__ import annotations

from tests.detector.rover import FULL, TICK_S, Rover, started
from wayfarer.hal import Snapshot, WheelReading
from wayfarer.safety.conditions import Condition


def says(rover: Rover, reading: WheelReading | None) -> tuple[Condition, ...]:
    """One tick in which all else is silent."""
    rover.t_s += TICK_S
    return rover.sees(Snapshot(rover.t_s, rover.compass, None, None, reading), FULL).conditions


def test_silent_wheels_are_stale_and_hide_no_stall() -> None:
    rover = started(watches_wheels=True)
    stalled = rover.drive(40)
    assert any(stalled)
    assert rover.tick().conditions == (Condition.WHEELS_STALE,)
    assert (
        rover.sees(Snapshot(rover.t_s, rover.compass, None, None, WheelReading(rover.t_s, 0.0, 0.0))).conditions == ()
    )


def test_reading_of_another_time_is_no_answer() -> None:
    rover = started(watches_wheels=True, watches_motion=False)
    rover.compass = None
    for t_s in (60.0, -60.0):
        found = [says(rover, WheelReading(rover.t_s + t_s, 0.0, 0.0)) for _ in range(10)]
        assert Condition.WHEELS_STALE in found[-1]


def test_rover_without_such_a_sensor_misses_nothing() -> None:
    rover = started(watches_motion=False)
    assert [rover.tick(moved_m=None).conditions for _ in range(40)] == [()] * 40
