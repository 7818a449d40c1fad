"""Duty that a slope takes up: what is added for it, what is learnt of it, and what never is."""

from __future__ import annotations

from math import radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.detector.rover import BACK, FULL, MAX_SPEED_M_S, PIVOT, VEHICLE, moved
from wayfarer.detector.ground import GradeCompensation
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.tick_interval import TickInterval

PERIOD_S = 0.05
CREEP = WheelCommand(0.3, 0.3)
LEG = WheelCommand(0.6, 0.6)


class Hill:
    """A rover on ground that rises ahead by ``pitch_deg``; gravity takes ``load * sin(pitch)`` of its duty."""

    def __init__(self, pitch_deg: float, load: float) -> None:
        self.grade = GradeCompensation(VEHICLE)
        self.pitch_deg, self.takes = pitch_deg, load * sin(radians(pitch_deg))
        self.t_s = 0.0
        self._level = STOP

    def drive(self, wheels: WheelCommand, for_s: float, *, free: bool = True) -> float:
        """Drive so; return the speed of the last tick, ahead positive."""
        speed_m_s = 0.0
        for _ in range(round(for_s / PERIOD_S)):
            applied = self.grade.compensate(wheels)
            self._level = self.grade.on_flat_ground(applied)
            speed_m_s = ((applied.left + applied.right) / 2.0 - self.takes) * MAX_SPEED_M_S if free else 0.0
            self.t_s += PERIOD_S
            ahead_m = (self._level.left + self._level.right) / 2.0 * MAX_SPEED_M_S * PERIOD_S
            interval = TickInterval(self.t_s, self._level, PERIOD_S, PERIOD_S, ahead_m)
            self.grade.update(interval, moved(ahead_m, speed_m_s * PERIOD_S, PERIOD_S), self.pitch_deg, free=free)
        return speed_m_s


@pytest.mark.parametrize("pitch_deg", [-16.0, -8.0, 8.0, 16.0])
@pytest.mark.parametrize("load", [0.2, 0.6, 0.9])
@pytest.mark.parametrize("wheels", [LEG, WheelCommand(-0.6, -0.6)])
def test_body_on_a_slope_has_the_speed_that_is_commanded_after_some_metres(
    pitch_deg: float, load: float, wheels: WheelCommand
) -> None:
    assert Hill(pitch_deg, load).drive(wheels, 12.0) == pytest.approx(wheels.left, abs=0.06)


def test_slow_leg_uphill_does_not_roll_back() -> None:
    """Backing off at 0.3 of full duty uphill stalled."""
    assert Hill(16.0, 0.9).drive(CREEP, 0.1) > 0.0


@pytest.mark.parametrize("wheels", [FULL, BACK, PIVOT, CREEP])
def test_level_ground_adds_nothing(wheels: WheelCommand) -> None:
    hill = Hill(0.0, 0.9)
    hill.drive(wheels, 2.0)
    assert hill.grade.compensate(wheels) == wheels


def test_body_that_something_holds_teaches_nothing() -> None:
    hill = Hill(12.0, 0.9)
    hill.drive(CREEP, 0.1)
    before = hill.grade.compensate(CREEP)
    hill.drive(CREEP, 5.0, free=False)
    assert hill.grade.compensate(CREEP) == before


@given(st.builds(WheelCommand, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), st.floats(-25.0, 25.0), st.floats(0.0, 2.0))
def test_slope_neither_starts_nor_reverses_nor_overdrives_the_wheels(
    wheels: WheelCommand, pitch_deg: float, load: float
) -> None:
    hill = Hill(pitch_deg, load)
    hill.drive(LEG, 3.0)
    assert hill.grade.compensate(STOP) == STOP
    applied = hill.grade.compensate(wheels)
    assert max(abs(applied.left), abs(applied.right)) <= 1.0 + 1e-9
    assert applied.left - applied.right == pytest.approx(wheels.left - wheels.right), "turning comes first"
    ahead, driven = wheels.left + wheels.right, applied.left + applied.right
    if wheels.left * wheels.right >= 0.0:
        assert driven * ahead >= 0.0
    assert hill.grade.on_flat_ground(applied) == pytest.approx(wheels)
