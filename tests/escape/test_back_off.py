"""How far a body backs off that rolls on after its wheels were stopped."""

from __future__ import annotations

from math import exp
from random import Random

import pytest

from tests.escape.walk import STUCK, observation
from wayfarer.config.rover_file import load_rover
from wayfarer.escape.api import Phase
from wayfarer.escape.catalogue import BUILT_IN


@pytest.mark.parametrize("rover", ["sim", "forestrover", "minirover"])
@pytest.mark.parametrize("lag_s", [0.05, 0.1, 0.15])
@pytest.mark.parametrize("share", [1.0, 0.5], ids=["grip", "half of the wheels' way"])
@pytest.mark.parametrize("measured", [True, False])
def test_backs_off_as_far_as_planned_with_its_roll(rover: str, lag_s: float, share: float, measured: bool) -> None:
    config = load_rover(rover)
    settings, tick_s = config.escape, 1.0 / config.control_hz
    handler = BUILT_IN["forest-pledge"].make(settings, config.vehicle, Random(1))
    handler.decide(observation(measured_m=0.0 if measured else None))
    seen = observation(t_s=tick_s, anomalies=STUCK, measured_m=0.0 if measured else None)
    speed_m_s = back_m = 0.0
    decision = handler.decide(seen)
    assert decision.phase is Phase.BACK_OFF
    while decision.phase is Phase.BACK_OFF:
        commanded_m_s = -sum(decision.wheels) / 2.0 * config.vehicle.max_speed_m_s
        before_m_s, speed_m_s = speed_m_s, commanded_m_s + (speed_m_s - commanded_m_s) * exp(-tick_s / lag_s)
        back_m += share * (commanded_m_s * tick_s - (speed_m_s - before_m_s) * lag_s)
        seen = seen._replace(
            t_s=seen.t_s + tick_s,
            anomalies=(),
            travelled_m=seen.travelled_m + commanded_m_s * tick_s,
            measured_m=back_m if measured else None,
        )
        decision = handler.decide(seen)
    rolled_out_m = back_m + share * speed_m_s * lag_s
    planned_m = settings.back_off_m if measured else share * settings.back_off_m
    wrong_lag_m = abs(lag_s - 0.1) * settings.reverse_m_s if measured else 0.0
    assert decision.why == "back_off.done"
    assert rolled_out_m == pytest.approx(planned_m, abs=0.6 * settings.reverse_m_s * tick_s + wrong_lag_m)
