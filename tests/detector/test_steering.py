"""Contact that shows without sight: a heading that does not answer steering."""

from __future__ import annotations

import pytest

from tests.detector.rover import SETTINGS, STEP_M, TICK_S, VEHICLE, Rover, started
from wayfarer.angles import wrap180
from wayfarer.escape.api import Anomaly
from wayfarer.hal import WheelCommand

CURVES = [WheelCommand(0.9, 0.3), WheelCommand(0.3, 0.9)]
STRIDE_TICKS = round(SETTINGS.blind_stride_m / STEP_M)


def drive(
    rover: Rover, wheels: WheelCommand, ticks: int, *, answer: float, moved_m: float, quality: float
) -> list[int]:
    """Drive a curve of which the body turns this share; return the ticks that were anomalies."""
    turn_deg = answer * 57.3 * (wheels.left - wheels.right) * VEHICLE.max_speed_m_s / VEHICLE.track_m * TICK_S
    heading_deg, found = 0.0, []
    for tick in range(ticks):
        heading_deg = wrap180(heading_deg + turn_deg)
        seen = rover.tick(wheels, moved_m=moved_m, quality=quality, heading_deg=heading_deg % 360.0)
        if Anomaly.IMMOBILISED in seen.anomalies:
            found.append(tick)
    return found


@pytest.mark.parametrize("wheels", CURVES, ids=["clockwise", "counter-clockwise"])
def test_body_that_does_not_answer_steering_is_stuck_before_its_blind_stride_is_over(wheels: WheelCommand) -> None:
    found = drive(started(), wheels, STRIDE_TICKS, answer=0.0, moved_m=0.0, quality=0.0)
    assert found
    assert found[0] <= STRIDE_TICKS / 2


@pytest.mark.parametrize("wheels", CURVES, ids=["clockwise", "counter-clockwise"])
@pytest.mark.parametrize("answer", [0.4, 1.0])
def test_body_that_answers_steering_keeps_its_blind_stride(wheels: WheelCommand, answer: float) -> None:
    assert drive(started(), wheels, STRIDE_TICKS, answer=answer, moved_m=0.0, quality=0.0) == []


def test_ground_that_was_seen_to_take_up_all_steering_shows_no_contact() -> None:
    rover = started()
    assert drive(rover, CURVES[0], 40, answer=0.0, moved_m=0.6 * STEP_M, quality=1.0) == []
    assert drive(rover, CURVES[0], STRIDE_TICKS, answer=0.0, moved_m=0.0, quality=0.0) == []


def test_steering_shows_nothing_while_the_ground_is_seen() -> None:
    """What is seen decides."""
    assert drive(started(), CURVES[0], STRIDE_TICKS, answer=0.0, moved_m=0.6 * STEP_M, quality=1.0) == []
