"""Dead reckoning from commands, and the slope of the ground."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.escape.walk import STUCK, observation
from wayfarer.escape.api import Phase
from wayfarer.escape.tactics import STALL_S, Reckoning

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


def test_stall_is_taken_back(reckoning: Reckoning) -> None:
    reckoning.take_back_stall(BEGIN)
    assert reckoning.ahead_m == 0.0
    reckoning.take_back_stall(BEGIN._replace(anomalies=STUCK))
    assert reckoning.ahead_m == pytest.approx(-STALL_S * 1.0)


def test_reset_begins_here(reckoning: Reckoning) -> None:
    assert (reckoning.ahead_m, reckoning.right_m) == (0.0, 0.0), "what was commanded before the first tick"
    reckoning.follow(BEGIN._replace(travelled_m=9.0), Phase.FOLLOW)
    reckoning.reset()
    reckoning.follow(BEGIN._replace(travelled_m=50.0), Phase.FOLLOW)
    assert (reckoning.ahead_m, reckoning.right_m) == (0.0, 0.0)


def rises(pitches_deg: list[float], tick_s: float = 0.05) -> list[float]:
    reckoning, risen = Reckoning(cruise_m_s=1.0), []
    for tick, pitch_deg in enumerate(pitches_deg):
        reckoning.follow(observation(t_s=tick * tick_s, pitch_deg=pitch_deg), Phase.FOLLOW)
        risen.append(reckoning.risen_deg)
    return risen


@given(st.floats(-20.0, 20.0))
def test_nose_that_rises_on_any_slope_has_risen(slope_deg: float) -> None:
    risen = rises([slope_deg] * 40 + [slope_deg + 1.5 * k for k in range(7)])
    assert risen[39] == pytest.approx(0.0, abs=1e-6)
    assert 7.0 < risen[-1] < 9.0


def test_long_climb_becomes_the_slope() -> None:
    assert rises([0.0] * 20 + [10.0] * 100)[-1] < 0.1


def test_first_pitch_is_level_whatever_the_clock_says() -> None:
    reckoning = Reckoning(cruise_m_s=1.0)
    for t_s, pitch_deg in ((-5000.0, 12.0), (-4999.0, 15.0)):
        reckoning.follow(observation(t_s=t_s, pitch_deg=pitch_deg), Phase.FOLLOW)
    assert 0.0 < reckoning.risen_deg < 3.0
    reckoning.reset()
    reckoning.follow(observation(t_s=0.0, pitch_deg=3.0), Phase.FOLLOW)
    assert reckoning.risen_deg == 0.0
