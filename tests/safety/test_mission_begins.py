"""The start delay and the goal heading that is captured at its end."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest

from wayfarer.angles import wrap180
from wayfarer.hal import CompassReading
from wayfarer.safety.mission import PATIENCE, ArmingSequence
from wayfarer.safety.settings import SafetySettings

SETTINGS = SafetySettings(start_delay_s=10.0, settle_s=1.0, settle_spread_deg=3.0)
PERIOD_S = 0.05


def captured(
    heading_deg: Callable[[float], float], goal_heading_deg: float | None = None
) -> tuple[float, float] | None:
    """Feed readings until the goal heading is there; return when, and what it is, or None if arming is refused."""
    arming = ArmingSequence(SETTINGS, 0.0, goal_heading_deg)
    for tick in range(1000):
        t_s = tick * PERIOD_S
        goal_deg = arming.update(CompassReading(t_s, heading_deg(t_s) % 360.0, 0.0, 0.0, None))
        if goal_deg is not None:
            return t_s, goal_deg
        if arming.too_late(t_s):
            return None
    raise AssertionError("arming neither ended nor was refused")


def test_given_heading_is_used_at_the_end_of_the_delay() -> None:
    assert captured(lambda _: 77.0, goal_heading_deg=123.0) == (10.0, 123.0)
    assert captured(lambda t_s: 90.0 * t_s, goal_heading_deg=5.0) == (10.0, 5.0), "it needs no rest"
    assert captured(lambda t_s: 45.0 * t_s) is None, "which its own heading does"


def test_own_heading_is_taken_after_the_delay_not_before() -> None:
    """Somebody leans over the compass until the delay ends."""
    result = captured(lambda t_s: 200.0 if t_s < 10.0 else 40.0)
    assert result is not None
    t_s, goal_deg = result
    assert t_s == pytest.approx(11.0)
    assert goal_deg == pytest.approx(40.0)


def test_own_heading_is_a_mean_across_north() -> None:
    noise = Random(1)
    result = captured(lambda _: noise.uniform(-2.0, 2.0))
    assert result is not None
    assert abs(wrap180(result[1])) < 1.0


def test_capture_waits_until_the_rover_has_come_to_rest() -> None:
    result = captured(lambda t_s: max(0.0, 13.0 - t_s) * 30.0)
    assert result is not None
    assert 13.5 < result[0] < 14.1
    assert abs(wrap180(result[1])) < 3.0


@pytest.mark.parametrize("spread_deg", [2.9, 3.1])
def test_spread_decides(spread_deg: float) -> None:
    swing = iter([spread_deg, -spread_deg] * 1000)
    assert (captured(lambda _: next(swing)) is None) is (spread_deg > SETTINGS.settle_spread_deg)


def test_patience_is_bounded() -> None:
    arming = ArmingSequence(SETTINGS, 100.0, None)
    last_s = 100.0 + SETTINGS.start_delay_s + PATIENCE * SETTINGS.settle_s
    assert not arming.too_late(last_s)
    assert arming.too_late(last_s + 0.001)
