"""A rover that stood still by itself warns before it drives on."""

from __future__ import annotations

import pytest

from wayfarer.safety.conditions import Condition
from wayfarer.safety.gate import FREE_S, LONG_HOLD_S, ResumeWarning
from wayfarer.safety.tick_interval import IntervalTimer, TickInterval

TICK_S = 0.0625  # binary, so that times are exact
WARNING_S = 1.0
SILENT = (Condition.COMPASS_STALE,)


class Rover:
    """Feeds a warning with ticks."""

    def __init__(self, warning_s: float = WARNING_S) -> None:
        self.warning = ResumeWarning(warning_s)
        self.timer = IntervalTimer(0.2, 1.0)
        self.t_s = 0.0
        self.tick()

    def tick(self, conditions: tuple[Condition, ...] = (), dt_s: float = TICK_S) -> bool:
        self.t_s += dt_s
        interval = TickInterval(self.t_s)
        self.timer.measure(interval)
        return self.warning.update(interval, conditions)

    def ticks(self, for_s: float, conditions: tuple[Condition, ...] = ()) -> list[bool]:
        return [self.tick(conditions) for _ in range(round(for_s / TICK_S))]

    def warns_for_s(self) -> float:
        """For how long it warns from now on."""
        return sum(self.ticks(3 * WARNING_S)) * TICK_S


@pytest.mark.parametrize(
    "conditions", [(), (Condition.OPERATOR_HOLD,), (Condition.MOTION_UNKNOWN, Condition.BATTERY_LOW)]
)
def test_rover_that_never_stood_or_was_held_by_a_person_does_not_warn(conditions: tuple[Condition, ...]) -> None:
    rover = Rover()
    rover.ticks(60.0, conditions)
    assert rover.warns_for_s() == 0.0


@pytest.mark.parametrize(("held_s", "warns"), [(LONG_HOLD_S - TICK_S, False), (LONG_HOLD_S + TICK_S, True)])
def test_it_warns_after_a_hold_of_more_than_a_second(held_s: float, warns: bool) -> None:
    rover = Rover()
    assert not any(rover.ticks(held_s, SILENT)), "while it is held there is nothing to warn of"
    assert rover.warns_for_s() == pytest.approx(WARNING_S * warns, abs=TICK_S)


@pytest.mark.parametrize(("gap_s", "warns"), [(0.6, False), (1.1, True), (3.0, True), (60.0, True)])
def test_it_warns_after_a_second_in_which_no_tick_came(gap_s: float, warns: bool) -> None:
    rover = Rover()
    assert not rover.tick((Condition.TICK_LATE,), dt_s=gap_s)
    assert rover.warns_for_s() == pytest.approx(WARNING_S * warns, abs=TICK_S)


def test_hold_of_the_rover_during_that_of_a_person_warns_once_the_person_lets_it_go() -> None:
    rover = Rover()
    rover.ticks(2.0, (Condition.OPERATOR_HOLD, *SILENT))
    assert not any(rover.ticks(5.0, (Condition.OPERATOR_HOLD,))), "the light would say that it drives off"
    assert rover.warns_for_s() == pytest.approx(WARNING_S, abs=TICK_S)


def test_plug_that_makes_contact_now_and_then_is_one_long_hold() -> None:
    rover = Rover()
    warned = False
    for _ in range(10):
        rover.ticks(0.9, SILENT)
        warned = any(rover.ticks(0.125)) or warned
    assert warned
    rover.ticks(0.9, SILENT)
    assert rover.warns_for_s() == pytest.approx(WARNING_S, abs=TICK_S), "it begins again"


def test_short_holds_of_a_rover_that_drives_between_them_are_no_long_one() -> None:
    rover = Rover()
    for _ in range(10):
        rover.ticks(0.9, SILENT)
        assert not any(rover.ticks(FREE_S + 2 * TICK_S))


def test_short_drives_between_holds_do_not_add_up() -> None:
    rover = Rover()
    rover.ticks(2.0, SILENT)
    for _ in range(10):
        assert all(rover.ticks(WARNING_S))
        assert not any(rover.ticks(FREE_S - TICK_S))
        rover.ticks(2 * TICK_S, SILENT)


def test_new_mission_forgets_and_no_time_to_warn_is_none() -> None:
    rover = Rover()
    rover.ticks(2.0, SILENT)
    rover.warning.reset()
    assert rover.warns_for_s() == 0.0
    hasty = Rover(warning_s=0.0)
    hasty.ticks(2.0, SILENT)
    assert hasty.warns_for_s() == 0.0
