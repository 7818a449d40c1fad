"""Touches, and bumpers that fall silent."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.detector.rover import ALL_WELL, SETTINGS, TICK_S, Detection, Rover, started
from wayfarer.escape.api import Anomaly
from wayfarer.hal import CompassReading, ContactReading, Side, Snapshot
from wayfarer.safety.conditions import Condition


def touching(rover: Rover, *sides: Side) -> Detection:
    rover.contact = ContactReading(rover.t_s, sides, None)
    return rover.tick()


@pytest.mark.parametrize("side", Side)
def test_touch_counts_at_once_where_contact_is_watched(side: Side) -> None:
    rover = Rover(watches_contact=True)
    assert touching(rover) == ALL_WELL
    assert touching(rover, side).anomalies == (Anomaly.TOUCHED,)
    assert touching(rover).anomalies == ()


def test_touch_is_no_anomaly_where_motion_is_watched() -> None:
    assert touching(started(), Side.FRONT) == ALL_WELL


def test_touch_may_have_to_last() -> None:
    rover = Rover(replace(SETTINGS, touch_s=2 * TICK_S), watches_contact=True)
    assert [touching(rover, Side.LEFT).anomalies for _ in range(4)] == [(), (), *[(Anomaly.TOUCHED,)] * 2]


def test_silent_contact_sensor_is_stale_and_touches_nothing() -> None:
    rover = Rover(watches_contact=True)
    assert touching(rover, Side.FRONT).anomalies == (Anomaly.TOUCHED,)
    found = [rover.tick() for _ in range(12)]
    assert {detection.anomalies for detection in found[:7]} == {(Anomaly.TOUCHED,)}
    assert set(found[8:]) == {Detection((), (Condition.CONTACT_STALE,))}
    assert touching(rover) == ALL_WELL


def test_contact_sensor_that_never_spoke_is_stale() -> None:
    rover = Rover(watches_contact=True)
    found = [rover.tick().conditions for _ in range(12)]
    assert found[0] == ()
    assert found[-1] == (Condition.CONTACT_STALE,)


def test_contact_that_is_only_needed_is_no_anomaly_but_must_not_fall_silent() -> None:
    rover = Rover(watches_motion=False, needs_contact=True)
    compass = CompassReading(0.0, 0.0, 0.0, 0.0, None)
    touch = ContactReading(0.0, (Side.LEFT,), None)
    assert rover.sees(Snapshot(0.0, compass, None, touch)) == ALL_WELL
    late_s = SETTINGS.contact_stale_s + TICK_S
    late = rover.sees(Snapshot(late_s, compass._replace(t_s=late_s), None, touch))
    assert late.conditions == (Condition.CONTACT_STALE,)
