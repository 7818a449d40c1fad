"""A rover that cannot turn on the spot says so, and gives up; one that turns the other way is stopped."""

from __future__ import annotations

import pytest

from wayfarer.detector.response import OPPOSES_DEG, SHOWS_LATE_S, TurnabilityMonitor
from wayfarer.detector.settings import DetectorSettings
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.tick_interval import TickInterval

TICK_S = 0.05
SETTINGS = DetectorSettings()
FULL = WheelCommand(1.0, -1.0)
REVERSED = (Condition.DRIVE_REVERSED,)


class Turns:
    """Feeds the monitor tick by tick; the body turns at the rate that a test gives."""

    def __init__(self, duty_max: float = 1.0) -> None:
        self.watch = TurnabilityMonitor(SETTINGS, duty_max)
        self.t_s = self.gained_deg = 0.0
        self.found: tuple[Condition, ...] = ()
        self.free = True

    def go(self, seconds: float, wheels: WheelCommand, rate_deg_s: float = 0.0) -> tuple[Condition, ...]:
        for _ in range(round(seconds / TICK_S)):
            self.t_s += TICK_S
            self.gained_deg += rate_deg_s * TICK_S
            interval = TickInterval(self.t_s, wheels, TICK_S, TICK_S, 0.0)
            self.found = self.watch.update(interval, self.gained_deg, free=self.free)
            if Condition.ENTRAPPED in self.found:
                break
        return self.found

    def tries(self, count: int, wheels: WheelCommand = FULL, rate_deg_s: float = 0.0) -> tuple[Condition, ...]:
        for _ in range(count):
            self.go(1.0, STOP)
            self.go(1.0, wheels, rate_deg_s)
        return self.found


def test_body_that_stands_at_full_duty_is_told_after_three_tries() -> None:
    turns = Turns()
    assert turns.tries(2) == ()
    assert turns.tries(1) == (Condition.CANNOT_TURN,)
    assert turns.go(5.0, STOP) == (Condition.CANNOT_TURN,), "until it has turned"


def test_arming_forgets_what_was_tried_before() -> None:
    turns = Turns()
    turns.tries(11)
    turns.watch.reset()
    assert turns.tries(2) == ()


def test_one_long_try_is_one() -> None:
    assert Turns().go(30.0, FULL) == ()


def test_rover_gives_up_after_twelve_tries_and_may_be_armed_again() -> None:
    turns = Turns()
    assert turns.tries(11) == (Condition.CANNOT_TURN,)
    assert turns.tries(1) == (Condition.CANNOT_TURN, Condition.ENTRAPPED)
    assert turns.go(1.0, STOP) == ()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turn_that_gets_on_forgets_the_tries(side: float) -> None:
    turns = Turns()
    turns.tries(5)
    assert turns.go(1.0, WheelCommand(side * 0.3, -side * 0.3), side * 20.0) == ()
    assert turns.tries(2) == ()


@pytest.mark.parametrize(("rate_deg_s", "turns"), [(-30.0, False), (8.0, False), (10.0, True)])
def test_turn_the_other_way_or_by_less_than_9_degrees_is_none(rate_deg_s: float, turns: bool) -> None:
    assert Turns().tries(3, rate_deg_s=rate_deg_s) == (() if turns else (Condition.CANNOT_TURN,))


def test_turn_that_is_stopped_half_way_is_a_failed_try() -> None:
    turns = Turns()
    turns.go(1.0, FULL, rate_deg_s=60.0)
    assert turns.go(1.0, FULL) == ()
    assert turns.tries(2) == (Condition.CANNOT_TURN,)


@pytest.mark.parametrize(
    "wheels", [WheelCommand(0.6, -0.6), WheelCommand(1.0, -0.5), WheelCommand(1.0, 0.2), WheelCommand(1.0, 1.0), STOP]
)
def test_less_than_full_duty_and_curves_are_no_try(wheels: WheelCommand) -> None:
    assert Turns().tries(20, wheels) == ()


@pytest.mark.parametrize(
    ("duty_max", "wheels"),
    [(0.5, (0.5, -0.5)), (0.5, (0.35, -0.35)), (1.0, (0.7, -0.7)), (1.0, (1.0, -0.7)), (1.0, (0.7, -1.0))],
)
def test_full_is_what_gate_and_battery_let_through_also_if_the_rover_moves_a_little(
    duty_max: float, wheels: tuple[float, float]
) -> None:
    assert Turns(duty_max).tries(3, WheelCommand(*wheels)) == (Condition.CANNOT_TURN,)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("duty", [0.2, 1.0])
@pytest.mark.parametrize("rate_deg_s", [60.0, 180.0])
def test_turn_that_goes_the_other_way_is_found_until_somebody_arms_again(
    side: float, duty: float, rate_deg_s: float
) -> None:
    turns = Turns()
    wheels = WheelCommand(side * duty, -side * duty)
    assert turns.go(SHOWS_LATE_S + OPPOSES_DEG / rate_deg_s + 0.1, wheels, -side * rate_deg_s) == REVERSED
    assert turns.go(1.0, STOP) == REVERSED
    turns.watch.reset()
    assert turns.go(1.0, wheels, side * rate_deg_s) == ()


@pytest.mark.parametrize("late_s", [0.0, 0.25, 0.5])
@pytest.mark.parametrize("rate_deg_s", [45.0, 180.0])
@pytest.mark.parametrize("turn_s", [0.4, 1.0, 3.0])
def test_turns_to_and_fro_that_a_compass_shows_late_go_the_commanded_way(
    late_s: float, rate_deg_s: float, turn_s: float
) -> None:
    turns, headings_deg = Turns(), [0.0] * (1 + round(late_s / TICK_S))
    turned_deg = 0.0
    for n in range(round(8 * turn_s / TICK_S)):
        way = 1.0 if n * TICK_S // turn_s % 2.0 == 0.0 else -1.0
        turned_deg += way * rate_deg_s * TICK_S
        headings_deg.append(turned_deg)
        turns.gained_deg = headings_deg.pop(0)
        assert turns.go(TICK_S, WheelCommand(way, -way)) != REVERSED


def test_what_a_body_does_in_curves_on_a_slope_or_while_its_heading_is_in_doubt_is_no_turn_the_other_way() -> None:
    turns = Turns()
    assert turns.go(10.0, WheelCommand(1.0, 0.2), -90.0) == ()
    turns.free = False
    assert turns.go(10.0, WheelCommand(0.3, -0.3), -90.0) == ()
    turns.free = True
    assert turns.go(0.4, WheelCommand(0.3, -0.3), -90.0) == ()
