"""Tilt to four sides, and overturned."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.detector.rover import ALL_WELL, SETTINGS, started
from wayfarer.escape.api import Anomaly
from wayfarer.safety.conditions import Condition

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


RISING_DEG = (0.0, 2.0, 7.0, 13.0, 20.0, 27.0, 36.0, 46.0, 55.0)  # a nose that rears up at a trunk in MuJoCo, 20 Hz


FAST_DEG = (0.0, 8.0, 17.0, 27.0)


@pytest.mark.parametrize(("axis", "sign", "anomaly"), TILTS)
def test_body_that_tips_over_is_found_before_its_tilt_has_lasted(axis: str, sign: int, anomaly: Anomaly) -> None:
    for rising_deg, found_at_deg in ((RISING_DEG, 27.0), (FAST_DEG, 17.0)):
        rover = started()
        found = [rover.tick(**angle(axis, sign * angle_deg), dt_s=0.05).anomalies for angle_deg in rising_deg]
        assert found.index((anomaly,)) <= rising_deg.index(found_at_deg)
    slow = started(replace(SETTINGS, tipping_deg=180.0))
    late = [slow.tick(**angle(axis, sign * angle_deg), dt_s=0.05).anomalies for angle_deg in RISING_DEG]
    assert not any(late)


@pytest.mark.parametrize(("axis", "sign", "_anomaly"), TILTS)
def test_one_reading_that_is_wrong_is_no_tipping(axis: str, sign: int, _anomaly: Anomaly) -> None:
    for wrong_deg in (15.0, 44.9, 180.0):
        rover = started()
        angles_deg = (0.0, 0.0, 0.5, wrong_deg, 0.0, 0.0, 0.0)
        found = [rover.tick(**angle(axis, sign * angle_deg)).anomalies for angle_deg in angles_deg]
        assert not any(found), wrong_deg


@pytest.mark.parametrize(("axis", "sign", "_anomaly"), TILTS)
def test_body_that_falls_back_is_not_tipping(axis: str, sign: int, _anomaly: Anomaly) -> None:
    for falling_deg in ((44.0, 40.0, 30.0, 15.0), (64.0, 63.0, 62.0, 61.0)):
        rover = started(replace(SETTINGS, tilt_s=1.0))
        found = [rover.tick(**angle(axis, sign * angle_deg), dt_s=0.05).anomalies for angle_deg in falling_deg]
        assert not any(found)


@example([-9.9, 0.0, 9.9])
@given(st.lists(st.floats(-9.9, 9.9), min_size=3, max_size=40))
def test_nothing_tips_below_half_of_the_limit(pitches_deg: list[float]) -> None:
    rover = started()
    assert {rover.tick(pitch_deg=pitch_deg, dt_s=0.05) for pitch_deg in pitches_deg} == {ALL_WELL}


def test_reading_that_is_seen_again_is_no_step() -> None:
    rover = started()
    for angle_deg in (0.0, 13.0, 26.0):
        rover.tick(pitch_deg=angle_deg, dt_s=0.05)
    assert Anomaly.NOSE_UP in rover.tick(compass=False, dt_s=0.05).anomalies
