"""The turn controller: a body that needs a share of the duty only to begin to turn is turned as it is told."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, exp

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.escape.walk import TICK_S, VEHICLE
from wayfarer.escape.turn_control import DEAD_ZONE_MAX, TurnController
from wayfarer.hal import WheelCommand

IDEAL_DEG_S = degrees(2.0 * VEHICLE.max_speed_m_s / VEHICLE.track_m)
LAG_S = 0.1


class Skidder:
    """A body that turns with what its turn duty has beyond a dead zone, with the lag of its motors."""

    def __init__(self, dead_zone: float, *, share: float = 1.0, controller: TurnController | None = None) -> None:
        self.controller = controller or TurnController(VEHICLE)
        self.dead_zone, self.share, self.held = dead_zone, share, False
        self.t_s = self.heading_deg = self.rate_deg_s = 0.0
        self.duty = 0.0
        self.headings_deg = [0.0]
        self.late_ticks = 0  # the compass shows the heading of so long ago

    def tick(self, speed_m_s: float, turn_deg_s: float) -> float:
        """Go on for a tick; return the heading gained."""
        beyond = max(abs(self.duty) - self.dead_zone, 0.0) * (1.0 if self.duty > 0.0 else -1.0)
        steady_deg_s = 0.0 if self.held else beyond * IDEAL_DEG_S * self.share
        self.rate_deg_s += (steady_deg_s - self.rate_deg_s) * (1.0 - exp(-TICK_S / LAG_S))
        gained_deg = self.rate_deg_s * TICK_S
        self.t_s += TICK_S
        self.heading_deg += gained_deg
        self.headings_deg.append(self.heading_deg)
        shown_deg = self.headings_deg[max(0, len(self.headings_deg) - 1 - self.late_ticks)]
        self.controller.observe(self.t_s, shown_deg % 360.0, None)
        left, right = self.controller.wheels(speed_m_s, turn_deg_s)
        self.duty = (left - right) / 2.0
        return gained_deg

    def rate_after_deg_s(self, seconds: float, turn_deg_s: float, speed_m_s: float = 0.0) -> float:
        """Turn for so long and return the mean rate of the last second."""
        gained = [self.tick(speed_m_s, turn_deg_s) for _ in range(round(seconds / TICK_S))]
        return sum(gained[-round(1.0 / TICK_S) :])


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("dead_zone", [0.0, 0.1, 0.3, 0.5, 0.7])
def test_body_turns_at_the_rate_it_is_told_on_any_ground(dead_zone: float, side: int) -> None:
    assert Skidder(dead_zone).rate_after_deg_s(4.0, side * 60.0) == pytest.approx(side * 60.0, rel=0.1)


@pytest.mark.parametrize("dead_zone", [0.1, 0.3, 0.5, 0.7])
def test_dead_zone_is_learnt_by_turning(dead_zone: float) -> None:
    body = Skidder(dead_zone)
    body.rate_after_deg_s(4.0, 60.0)
    assert body.controller.dead_zone == pytest.approx(dead_zone, abs=0.05)


def test_what_was_learnt_makes_the_next_turn_prompt() -> None:
    novice, expert = Skidder(0.5), Skidder(0.5)
    expert.rate_after_deg_s(4.0, -60.0)
    expert.rate_after_deg_s(1.0, 0.0)
    for body in (novice, expert):
        body.controller.begin_manoeuvre()
    turned = [sum(body.tick(0.0, 60.0) for _ in range(8)) for body in (novice, expert)]
    assert turned[1] > 2.0 * turned[0]


def lagging(late_ticks: int, dead_zone: float) -> Skidder:
    """A body whose controller has found out on ideal ground that the compass lags, and that comes to other ground."""
    body = Skidder(0.0)
    body.late_ticks = late_ticks
    for turn in range(6):
        body.rate_after_deg_s(0.5, 90.0 if turn % 2 else -90.0)
        body.rate_after_deg_s(1.0, 0.0)
    assert body.controller.lag.ticks == late_ticks
    body.dead_zone = dead_zone
    body.controller.begin_manoeuvre()
    return body


@pytest.mark.parametrize("late_ticks", [6, 10])
@pytest.mark.parametrize("dead_zone", [0.2, 0.4, 0.6])
def test_dead_zone_is_learnt_from_turns_that_are_shown_late(dead_zone: float, late_ticks: int) -> None:
    """A predicted turn follows from the dead zone that is assumed: learning from it would confirm any."""
    body = lagging(late_ticks, dead_zone)
    body.rate_after_deg_s(8.0, 90.0)
    assert body.controller.dead_zone == pytest.approx(dead_zone, abs=0.1)


@pytest.mark.parametrize("late_ticks", [6, 10])
def test_body_that_stands_is_turned_although_its_compass_lags(late_ticks: int) -> None:
    """Its feedback is slow because of the lag, but not for as long as the body stands: there is no loop to excite."""
    body, turned_deg = lagging(late_ticks, 0.6), 0.0
    while not body.controller.blocked and turned_deg < 30.0:
        turned_deg += body.tick(0.0, 90.0)
        assert body.t_s < 40.0
    assert turned_deg >= 30.0


def test_body_that_is_held_teaches_nothing_and_gets_full_duty() -> None:
    body = Skidder(0.2)
    body.rate_after_deg_s(4.0, 60.0)
    learnt = body.controller.dead_zone
    body.held = True
    body.rate_after_deg_s(2.0, 90.0)
    assert body.controller.dead_zone == pytest.approx(learnt, abs=0.05)
    assert body.duty == 1.0


def test_body_that_comes_free_does_not_fly_round() -> None:
    body = Skidder(0.2)
    body.rate_after_deg_s(4.0, 60.0)
    body.held = True
    body.rate_after_deg_s(2.0, 60.0)
    body.held = False
    assert sum(body.tick(0.0, 60.0) for _ in range(round(0.5 / TICK_S))) < 80.0, "full duty would have been 128"


def test_body_that_was_turned_by_hand_is_not_turned_back() -> None:
    body = Skidder(0.2)
    body.rate_after_deg_s(4.0, 60.0)
    learnt = body.controller.dead_zone
    body.heading_deg += 120.0
    body.tick(0.5, 0.0)
    left, right = body.controller.wheels(0.5, 0.0)
    assert left == pytest.approx(right, abs=0.05)
    assert body.controller.dead_zone == pytest.approx(learnt, abs=0.02)


@pytest.mark.parametrize(("speed_m_s", "turn_deg_s"), [(0.0, 90.0), (1.0, 30.0), (0.4, -120.0)])
def test_full_duty_that_turns_nothing_is_told_after_two_seconds(speed_m_s: float, turn_deg_s: float) -> None:
    body = Skidder(0.0)
    body.held = True
    pushed_s = 0.0
    while not body.controller.blocked:
        body.tick(speed_m_s, turn_deg_s)
        pushed_s += TICK_S * (abs(body.duty) > 0.5)
        assert body.t_s < 20.0
    assert pushed_s <= 3.5
    body.controller.begin_manoeuvre()
    assert not body.controller.blocked


def test_body_that_turns_never_stands() -> None:
    body = Skidder(0.5)
    for _ in range(400):
        body.tick(0.0, 60.0)
        assert not body.controller.blocked


def test_what_the_gate_cuts_off_is_not_taken_for_the_ground() -> None:
    controller, heading_deg = TurnController(VEHICLE), 0.0
    for tick in range(100):
        applied = WheelCommand(0.3, -0.3) if tick else None
        heading_deg += 0.3 * IDEAL_DEG_S * TICK_S if tick else 0.0
        controller.observe(tick * TICK_S, heading_deg % 360.0, applied)
        controller.wheels(0.0, 180.0)
    assert controller.dead_zone == pytest.approx(0.0, abs=0.02)


def test_measured_dead_zone_is_where_it_begins_and_what_reset_goes_back_to() -> None:
    controller = TurnController(replace(VEHICLE, turn_from_duty=0.4))
    assert controller.dead_zone == 0.4
    assert controller.wheels(0.0, 30.0).left == pytest.approx(0.4 + 30.0 / IDEAL_DEG_S)
    body = Skidder(0.1, controller=controller)
    body.rate_after_deg_s(4.0, 60.0)
    assert controller.dead_zone < 0.2
    controller.reset()
    assert controller.dead_zone == 0.4


@given(
    st.floats(0.0, 0.9),
    st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-200.0, 200.0), st.floats(0.0, 360.0)), max_size=60),
)
def test_duties_and_dead_zone_never_leave_their_range(
    dead_zone: float, ticks: list[tuple[float, float, float]]
) -> None:
    controller = TurnController(replace(VEHICLE, turn_from_duty=dead_zone))
    for tick, (speed_m_s, turn_deg_s, heading_deg) in enumerate(ticks):
        controller.observe(tick * TICK_S, heading_deg % 360.0, None)
        assert all(-1.0 <= duty <= 1.0 for duty in controller.wheels(speed_m_s, turn_deg_s))
        assert 0.0 <= controller.dead_zone <= DEAD_ZONE_MAX


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-180.0, 180.0)), max_size=40), st.floats(0.0, 0.6))
def test_left_and_right_are_alike(commands: list[tuple[float, float]], dead_zone: float) -> None:
    body, mirrored = Skidder(dead_zone), Skidder(dead_zone)
    for speed_m_s, turn_deg_s in commands:
        assert body.tick(speed_m_s, turn_deg_s) == pytest.approx(-mirrored.tick(speed_m_s, -turn_deg_s), abs=1e-6)


def test_turning_comes_before_going_ahead() -> None:
    left, right = TurnController(VEHICLE).wheels(VEHICLE.max_speed_m_s, 0.5 * IDEAL_DEG_S)
    assert (left, right) == (1.0, 0.0)


def test_speed_in_a_curve_falls_where_the_ground_takes_up_duty() -> None:
    controller = TurnController(VEHICLE)
    assert controller.curve_speed_m_s(0.5, 1.0) == 0.5
    controller.dead_zone = 0.6
    slow_m_s = controller.curve_speed_m_s(1.0, 1.0)
    assert 0.2 < slow_m_s < 0.5
    left, right = controller.wheels(slow_m_s, degrees(slow_m_s))
    assert (left + right) / 2.0 * VEHICLE.max_speed_m_s == pytest.approx(slow_m_s), "nothing is cut off"
