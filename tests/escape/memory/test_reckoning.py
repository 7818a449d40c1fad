"""Dead reckoning along and across the goal heading: the mission's own, else from commands."""

from __future__ import annotations

import pytest

from tests.escape.walk import STUCK, observation
from wayfarer.escape.api import Phase
from wayfarer.escape.memory.reckoning import STALL_S, Reckoning

BEGIN = observation(travelled_m=7.0, heading_deg=90.0, goal_heading_deg=90.0)


@pytest.fixture
def reckoning() -> Reckoning:
    made = Reckoning(cruise_m_s=1.0)
    made.follow(BEGIN, Phase.FOLLOW)
    return made


@pytest.mark.parametrize(
    ("phase", "heading_deg", "expected"),
    [
        (Phase.FOLLOW, 90.0, (2.0, 0.0)),
        (Phase.PROBE, 180.0, (0.0, 2.0)),
        (Phase.STRIDE, 0.0, (0.0, -2.0)),
        (Phase.BACK_OFF, 90.0, (-2.0, 0.0)),
        (Phase.TURN_AWAY, 90.0, (0.0, 0.0)),
    ],
)
def test_commands_lead_along_the_compass(
    reckoning: Reckoning, phase: Phase, heading_deg: float, expected: tuple[float, float]
) -> None:
    reckoning.follow(BEGIN._replace(travelled_m=9.0, heading_deg=heading_deg), phase)
    assert (reckoning.ahead_m, reckoning.right_m) == pytest.approx(expected)


def test_dead_reckoning_of_the_mission_counts_whatever_was_commanded(reckoning: Reckoning) -> None:
    seen = BEGIN._replace(travelled_m=9.0, north_m=1.0, east_m=3.0, anomalies=STUCK)
    reckoning.follow(seen, Phase.BACK_OFF)
    assert (reckoning.ahead_m, reckoning.right_m) == pytest.approx((3.0, -1.0)), "the goal is in the east"
    reckoning.take_back_stall()
    assert (reckoning.ahead_m, reckoning.right_m) == pytest.approx((3.0, -1.0)), "the motion sensor saw the stall"


def test_stall_that_nothing_measured_is_taken_back(reckoning: Reckoning) -> None:
    reckoning.take_back_stall()
    assert reckoning.ahead_m == 0.0, "there is none"
    reckoning.follow(BEGIN._replace(anomalies=STUCK, measured_m=7.0), Phase.FOLLOW)
    reckoning.take_back_stall()
    assert reckoning.ahead_m == 0.0, "it was measured"
    reckoning.follow(BEGIN._replace(anomalies=STUCK), Phase.FOLLOW)
    reckoning.take_back_stall()
    assert reckoning.ahead_m == pytest.approx(-STALL_S * 1.0)


def test_reset_begins_here(reckoning: Reckoning) -> None:
    assert (reckoning.ahead_m, reckoning.right_m) == (0.0, 0.0), "what was commanded before the first tick"
    reckoning.follow(BEGIN._replace(travelled_m=9.0), Phase.FOLLOW)
    reckoning.reset()
    reckoning.follow(BEGIN._replace(travelled_m=50.0), Phase.FOLLOW)
    assert (reckoning.ahead_m, reckoning.right_m) == (0.0, 0.0)
