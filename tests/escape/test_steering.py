"""Wheel mixing and heading hold."""

from __future__ import annotations

from dataclasses import replace
from math import cos, degrees, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.escape.walk import SETTINGS, VEHICLE, observation
from wayfarer.escape.manoeuvres import EscapePlan, Follow, Manoeuvre, Stride
from wayfarer.escape.turn_control import HeadingControl, TurnController
from wayfarer.hal import WheelCommand


@given(st.floats(-10.0, 10.0), st.floats(-20.0, 20.0))
def test_mixed_duties_never_leave_the_range(speed_m_s: float, turn_rad_s: float) -> None:
    assert all(-1.0 <= duty <= 1.0 for duty in VEHICLE.mix(speed_m_s, turn_rad_s))


@given(st.floats(0.5, 10.0), st.floats(-20.0, 20.0))
def test_mixing_beyond_full_duty_keeps_the_curve(speed_m_s: float, turn_rad_s: float) -> None:
    left, right = VEHICLE.mix(speed_m_s, turn_rad_s)
    radius_per_track = (left + right) / 2.0
    assert (left - right) / VEHICLE.track_m * speed_m_s == pytest.approx(radius_per_track * turn_rad_s, abs=1e-9)


def test_full_speed_ahead_is_full_duty() -> None:
    assert VEHICLE.mix(VEHICLE.max_speed_m_s, 0.0) == (1.0, 1.0)
    assert VEHICLE.mix(0.0, 0.0) == (0.0, 0.0)


@pytest.mark.parametrize("error_deg", [5.0, 40.0, 59.0, 61.0, 179.0])
def test_wheels_turn_towards_the_goal(error_deg: float) -> None:
    left, right = HeadingControl(SETTINGS, TurnController(VEHICLE)).wheels(0.0, error_deg)
    assert left > right, "a goal that lies clockwise needs the left wheels to be faster"
    assert HeadingControl(SETTINGS, TurnController(VEHICLE)).wheels(0.0, -error_deg) == (right, left)


@pytest.mark.parametrize(("error_deg", "pivots"), [(59.5, False), (60.0, True), (120.0, True), (-180.0, True)])
def test_beyond_60_degrees_it_turns_on_the_spot(error_deg: float, pivots: bool) -> None:
    left, right = HeadingControl(SETTINGS, TurnController(VEHICLE)).wheels(0.0, error_deg)
    assert (left == -right) is pivots


def test_speed_falls_with_the_cosine_of_the_error() -> None:
    left, right = HeadingControl(SETTINGS, TurnController(VEHICLE)).wheels(0.0, 20.0)
    assert (left + right) / 2 * VEHICLE.max_speed_m_s == pytest.approx(SETTINGS.cruise_m_s * cos(radians(20.0)))


def turn(wheels: WheelCommand) -> float:
    return wheels.left - wheels.right


@pytest.mark.parametrize("kind", [Follow, Stride])
def test_steady_error_is_learnt_and_forgotten_when_a_manoeuvre_begins(kind: type[Manoeuvre]) -> None:
    manoeuvre = kind(SETTINGS, TurnController(VEHICLE), EscapePlan())
    manoeuvre.begin(observation())
    off = observation(heading_deg=355.0)
    first = turn(manoeuvre.wheels(off))
    for tick in range(1, 41):
        learnt = turn(manoeuvre.wheels(off._replace(t_s=tick * 0.05)))
    # 2 s of error under the integral gain, over the proportional part.
    assert learnt / first == pytest.approx(1.0 + SETTINGS.heading_i * 2.0 / SETTINGS.heading_p)
    manoeuvre.begin(observation(t_s=9.0))
    assert turn(manoeuvre.wheels(off._replace(t_s=9.0))) == first


def test_pivot_is_not_learnt() -> None:
    hold = HeadingControl(SETTINGS, TurnController(VEHICLE))
    for tick in range(40):
        hold.wheels(tick * 0.05, 90.0)
    assert turn(hold.wheels(2.0, 0.0)) == 0.0


def test_turn_rate_is_limited() -> None:
    slow = replace(SETTINGS, turn_deg_s=45.0)
    left, right = HeadingControl(slow, TurnController(VEHICLE)).wheels(0.0, 179.0)
    assert (left - right) * VEHICLE.max_speed_m_s / VEHICLE.track_m == pytest.approx(pi / 4)


def turn_deg_s(wheels: WheelCommand) -> float:
    return degrees(turn(wheels) * VEHICLE.max_speed_m_s / VEHICLE.track_m)


@pytest.mark.parametrize(
    ("after_s", "error_deg", "rate_deg_s"),
    [(0.05, 19.0, -20.0), (0.1, 18.0, -20.0), (0.05, 20.0, 0.0), (0.1, 24.0, 40.0), (0.0, 19.0, 0.0)],
    ids=["closing", "closing, slow ticks", "steady", "growing", "no time between"],
)
def test_derivative_acts_on_the_rate_of_the_error(after_s: float, error_deg: float, rate_deg_s: float) -> None:
    turns_deg_s = []
    for gain in (0.5, 0.0):
        hold = HeadingControl(replace(SETTINGS, heading_i=0.0, heading_d=gain), TurnController(VEHICLE))
        hold.wheels(0.0, 20.0)
        turns_deg_s.append(turn_deg_s(hold.wheels(after_s, error_deg)))
    assert turns_deg_s[0] - turns_deg_s[1] == pytest.approx(0.5 * rate_deg_s, abs=1e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_rover_that_was_held_off_its_heading_turns_on_by_17_degrees_a_second_at_most(side: int) -> None:
    hold = HeadingControl(SETTINGS, TurnController(VEHICLE))
    for tick in range(1200):
        hold.wheels(tick * 0.05, side * 50.0)
    assert side * turn_deg_s(hold.wheels(60.0, 0.0)) == pytest.approx(17.0, abs=0.5)
