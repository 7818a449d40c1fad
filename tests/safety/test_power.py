"""What board and supply report: a sag is no empty battery, one flag is no fault, and dips limit the duty."""

from __future__ import annotations

from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.hal import MotorHealth
from wayfarer.safety.conditions import Condition
from wayfarer.safety.power import DIPS, DIPS_S, MotorBoardMonitor, SupplyMonitor, meaning
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
    assert [Condition.MOTORS_FAILED in conditions for conditions in found] == expected


def test_board_that_falls_silent_says_nothing_any_more() -> None:
    watch = MotorBoardMonitor(SETTINGS)
    assert (watch.health, watch.conditions) == (None, ()), "nothing is known before the first answer"
    for count in range(50):
        watch.update(count * STEP_S, MotorHealth(9.0, ("motor A: drive fault",)))
    assert Condition.MOTORS_FAILED in watch.conditions
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


# -- the computer's supply ---------------------------------------------------------------------------------------------

LOW, WELL, SINCE_BOOT = 0x50005, 0x0, 0x50000
UNDERVOLTAGE, UNSTABLE = (Condition.UNDERVOLTAGE,), (Condition.POWER_UNSTABLE,)


def after(*flags: int | None, every_s: float = 1.0) -> SupplyMonitor:
    """A watch that was given these flags, one each so many seconds."""
    watch = SupplyMonitor()
    for count, each in enumerate(flags):
        watch.update(count * every_s, each)
    return watch


@pytest.mark.parametrize("flags", [None, WELL, SINCE_BOOT, 0xE])
def test_supply_that_is_well_or_unknown_demands_nothing(flags: int | None) -> None:
    watch = after(flags, flags)
    assert (watch.noticed, watch.conditions(1.0)) == (False, ())


def test_low_supply_is_degraded_for_as_long_as_it_is_low() -> None:
    assert after(LOW).conditions(0.0) == UNDERVOLTAGE
    assert after(WELL, LOW, LOW).conditions(2.0) == UNDERVOLTAGE
    assert after(WELL, LOW, SINCE_BOOT).conditions(2.0) == ()
    assert after(LOW, None).conditions(1.0) == (), "what cannot be read is not known to be low"


@given(st.lists(st.tuples(st.floats(0.5, 40.0), st.booleans()), max_size=40))
def test_unstable_is_three_rises_in_a_minute_and_nothing_else(polls: list[tuple[float, bool]]) -> None:
    watch, t_s, was_low = SupplyMonitor(), 0.0, False
    rises_s: list[float] = []
    for after_s, is_low in polls:
        t_s += after_s
        rises_s += [t_s] if is_low and not was_low else []
        was_low = is_low
        watch.update(t_s, LOW if is_low else WELL)
        recent = [rise_s for rise_s in rises_s if t_s - rise_s < DIPS_S]
        assert (Condition.POWER_UNSTABLE in watch.conditions(t_s)) is (len(recent) >= DIPS)
        assert (Condition.UNDERVOLTAGE in watch.conditions(t_s)) is is_low


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (0x0, "all well"),
        (0x1, "under-voltage now"),
        (0x50005, "under-voltage now, slowed down now, under-voltage since boot, slowed down since boot"),
        (0x10000, "under-voltage since boot"),
    ],
)
def test_flags_are_told_in_words(flags: int, said: str) -> None:
    assert meaning(flags) == said
