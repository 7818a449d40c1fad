"""The motor board's own word: a sag is no empty battery, and one flag is no fault."""

from __future__ import annotations

from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.hal import MotorHealth
from wayfarer.safety.conditions import Condition
from wayfarer.safety.motor_board import MotorBoardMonitor
from wayfarer.safety.settings import BoardSettings

SETTINGS = BoardSettings(battery_low_v=11.0, battery_critical_v=10.0, battery_low_s=10.0, battery_critical_s=5.0)
FULL = MotorHealth(12.0, ())
STEP_S = 0.25


def said(settings: BoardSettings, *answers: MotorHealth, step_s: float = STEP_S) -> list[tuple[Condition, ...]]:
    """The conditions after each of these answers, which come at a fixed rate."""
    watch, found = MotorBoardMonitor(settings), []
    for count, answer in enumerate(answers):
        watch.update(count * step_s, answer)
        found.append(watch.conditions)
    return found


def test_low_battery_counts_after_ten_seconds_and_critical_after_five() -> None:
    low = said(SETTINGS, *[MotorHealth(10.5, ())] * 50)
    assert [conditions != () for conditions in low] == [False] * 40 + [True] * 10
    assert low[-1] == (Condition.BATTERY_LOW,)
    critical = said(SETTINGS, *[MotorHealth(9.5, ())] * 50)
    assert [Condition.BATTERY_CRITICAL in conditions for conditions in critical] == [False] * 20 + [True] * 30
    assert critical[-1] == (Condition.BATTERY_LOW, Condition.BATTERY_CRITICAL)


def test_sag_under_load_is_no_empty_battery() -> None:
    starts = [MotorHealth(9.0, ())] * 19 + [FULL]
    assert set(said(SETTINGS, *starts * 5)) == {()}


@pytest.mark.parametrize("battery_v", [None, 0.1])
def test_battery_is_not_judged_without_limits_or_without_a_voltage(battery_v: float | None) -> None:
    assert set(said(BoardSettings(), *[MotorHealth(battery_v, ())] * 100)) == {()}
    assert set(said(SETTINGS, *[MotorHealth(None, ())] * 100)) == {()}


@given(st.lists(st.tuples(st.sampled_from([0.5, 1.0, 3.0, 7.0]), st.sampled_from([9.5, 10.5, 12.0])), max_size=40))
def test_battery_is_low_when_it_was_low_without_a_gap_for_long_enough(answers: list[tuple[float, float]]) -> None:
    watch = MotorBoardMonitor(SETTINGS)
    times_s = list(accumulate(after_s for after_s, _ in answers))
    low_since_s: float | None = None
    for t_s, (_, battery_v) in zip(times_s, answers, strict=True):
        watch.update(t_s, MotorHealth(battery_v, ()))
        low_since_s = None if battery_v >= 11.0 else t_s if low_since_s is None else low_since_s
        expected = low_since_s is not None and t_s - low_since_s >= 10.0
        assert (Condition.BATTERY_LOW in watch.conditions) is expected


@given(st.lists(st.booleans(), max_size=30))
def test_fault_counts_when_the_board_says_it_twice_in_a_row(faulty: list[bool]) -> None:
    """A flag that is up at power-up takes a moment to clear."""
    found = said(SETTINGS, *(MotorHealth(12.0, ("motor A: drive fault",) if fault else ()) for fault in faulty))
    expected = [now and before for before, now in zip([False, *faulty], faulty, strict=False)]
    assert [Condition.BOARD_FAULT in conditions for conditions in found] == expected


def test_board_that_falls_silent_says_nothing_any_more() -> None:
    watch = MotorBoardMonitor(SETTINGS)
    assert (watch.health, watch.conditions) == (None, ()), "nothing is known before the first answer"
    for count in range(50):
        watch.update(count * STEP_S, MotorHealth(9.0, ("motor A: drive fault",)))
    assert Condition.BOARD_FAULT in watch.conditions
    watch.silent()
    assert (watch.health, watch.conditions) == (None, (Condition.BOARD_SILENT,))
    watch.update(50 * STEP_S, FULL)
    assert (watch.health, watch.conditions) == (FULL, ())


@pytest.mark.parametrize("critical_v", [11.0, 12.0])
def test_limits_that_are_upside_down_are_refused(critical_v: float) -> None:
    with pytest.raises(ValueError, match=rf"battery_critical_v = {critical_v:g} must be below battery_low_v = 11"):
        BoardSettings(battery_low_v=11.0, battery_critical_v=critical_v)


@pytest.mark.parametrize("limits", [{"battery_low_v": 11.0}, {"battery_critical_v": 10.0}])
def test_one_limit_alone_is_enough(limits: dict[str, float]) -> None:
    condition = Condition.BATTERY_LOW if "battery_low_v" in limits else Condition.BATTERY_CRITICAL
    assert said(BoardSettings(**limits), *[MotorHealth(9.0, ())] * 60)[-1] == (condition,)
