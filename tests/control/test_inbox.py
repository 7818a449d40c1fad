"""The inbox: the newest reading wins, displacement is never lost."""

from __future__ import annotations

from math import inf, isfinite, nan
from typing import Any

import pytest

from wayfarer.control.tick import Inbox
from wayfarer.hal import CompassReading, ContactReading, MotionReading, Snapshot, WheelReading


def snapshot(inbox: Inbox, t_s: float) -> Snapshot:
    """What a tick at this time is told."""
    inputs = inbox.take(t_s)
    return Snapshot(t_s, inputs.compass, inputs.motion, inputs.contact, inputs.wheels)


def test_nothing_is_there_before_the_sensors_speak() -> None:
    assert snapshot(Inbox(), 1.5) == Snapshot(1.5, None, None, None, None)


def test_newest_reading_replaces_the_older_and_stays() -> None:
    inbox = Inbox()
    old, new = (CompassReading(t_s, 10.0, 0.0, 0.0, None) for t_s in (0.0, 0.1))
    inbox.put_compass(old)
    inbox.put_compass(new)
    inbox.put_contact(contact := ContactReading(0.0, (), None))
    for t_s in (0.2, 0.3):
        assert snapshot(inbox, t_s) == Snapshot(t_s, new, None, contact)


def test_displacements_add_up_until_they_are_taken() -> None:
    inbox = Inbox()
    inbox.put_motion(MotionReading(0.1, 0.25, -0.5, 0.9))
    inbox.put_motion(MotionReading(0.2, 0.5, 0.25, 0.4))
    inbox.put_motion(MotionReading(0.3, -0.125, 0.0, 0.8))
    assert snapshot(inbox, 0.3).motion == MotionReading(0.3, 0.625, -0.25, 0.4), "quality is that of the worst part"
    assert snapshot(inbox, 0.4).motion is None


def test_displacements_without_a_direction_stay_without_one() -> None:
    inbox = Inbox()
    for t_s in (0.1, 0.2):
        inbox.put_motion(MotionReading(t_s, 0.25, 0.0, 0.9, signed=False))
    assert snapshot(inbox, 0.2).motion == MotionReading(0.2, 0.5, 0.0, 0.9, signed=False)


@pytest.mark.parametrize("field", ["t_s", "forward_m", "right_m", "quality"])
@pytest.mark.parametrize("value", [nan, inf])
@pytest.mark.parametrize("first", [True, False])
def test_part_that_is_no_number_leaves_no_displacement_to_be_believed(field: str, value: float, first: bool) -> None:
    """Fault catalogue, fault 8: what one part hides is unknown, not the rest of the sum."""
    good = MotionReading(0.1, 0.01, 0.0, 0.9)
    change: dict[str, Any] = {field: value}
    bad = good._replace(**change)
    inbox = Inbox()
    for reading in (bad, good) if first else (good, bad):
        inbox.put_motion(reading)
    motion = snapshot(inbox, 0.1).motion
    assert motion is not None
    assert motion.quality == 0.0 or not isfinite(motion.forward_m + motion.right_m)


def test_ways_of_the_rims_add_up_and_the_current_is_the_newest() -> None:
    inbox = Inbox()
    inbox.put_wheels(WheelReading(0.1, 0.25, -0.5, 3.0, 1.0))
    inbox.put_wheels(WheelReading(0.2, 0.5, 0.25, 2.0, None))
    assert snapshot(inbox, 0.2).wheels == WheelReading(0.2, 0.75, -0.25, 2.0, None)
    assert snapshot(inbox, 0.3).wheels is None
    assert inbox.wheels == WheelReading(0.2, 0.5, 0.25, 2.0, None), "what a check of the part is shown"


def test_way_of_which_a_part_is_not_known_is_not_known() -> None:
    inbox = Inbox()
    for left_m, right_m in ((0.1, None), (0.1, 0.1), (0.1, 0.1)):
        inbox.put_wheels(WheelReading(0.1, left_m, right_m))
    wheels = snapshot(inbox, 0.2).wheels
    assert wheels is not None
    assert wheels.left_m == pytest.approx(0.3)
    assert wheels.right_m is None
