"""Tilt to four sides, and overturned."""

from __future__ import annotations

from typing import Any

import pytest

from tests.detector.rover import started
from wayfarer.conditions import Condition
from wayfarer.detector import ALL_WELL
from wayfarer.escape.api import Anomaly

TILTS = [
    ("pitch_deg", 1, Anomaly.NOSE_UP),
    ("pitch_deg", -1, Anomaly.NOSE_DOWN),
    ("roll_deg", 1, Anomaly.RIGHT_DOWN),
    ("roll_deg", -1, Anomaly.LEFT_DOWN),
]


def angle(axis: str, angle_deg: float) -> dict[str, Any]:
    return {axis: angle_deg}


@pytest.mark.parametrize(("axis", "sign", "anomaly"), TILTS)
def test_tilt_counts_once_it_has_lasted(axis: str, sign: int, anomaly: Anomaly) -> None:
    rover = started()
    found = [rover.tick(**angle(axis, sign * 20.0)).anomalies for _ in range(6)]
    assert found == [(), (), (), (), (anomaly,), (anomaly,)]
    assert rover.tick().anomalies == ()


@pytest.mark.parametrize(("axis", "sign", "_anomaly"), TILTS)
def test_tilt_below_the_limit_is_rough_ground(axis: str, sign: int, _anomaly: Anomaly) -> None:
    rover = started()
    assert {rover.tick(**angle(axis, sign * 19.9)) for _ in range(20)} == {ALL_WELL}


def test_tilt_must_last_without_a_gap() -> None:
    rover = started()
    assert {rover.tick(pitch_deg=25.0 if n % 4 else 0.0) for n in range(40)} == {ALL_WELL}


def test_each_tilt_persists_by_itself() -> None:
    rover = started()
    assert {rover.tick(pitch_deg=25.0 * (-1) ** n) for n in range(20)} == {ALL_WELL}


def test_both_axes_can_be_wrong_at_once() -> None:
    rover = started()
    for _ in range(5):
        detection = rover.tick(pitch_deg=-30.0, roll_deg=-30.0)
    assert set(detection.anomalies) == {Anomaly.NOSE_DOWN, Anomaly.LEFT_DOWN}


@pytest.mark.parametrize(("axis", "sign", "_anomaly"), TILTS)
@pytest.mark.parametrize(("angle_deg", "over"), [(59.9, False), (60.0, True), (180.0, True)])
def test_overturned_acts_soon_and_not_upon_one_reading(
    axis: str, sign: int, _anomaly: Anomaly, angle_deg: float, over: bool
) -> None:
    """One bit that is wrong on the wire, in the roll beyond what the 8-bit register shows, must not end a mission."""
    rover = started()
    found = [Condition.OVERTURNED in rover.tick(**angle(axis, sign * angle_deg)).conditions for _ in range(4)]
    assert not found[0]
    assert found[-1] is over
