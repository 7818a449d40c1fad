"""The computer's supply: less duty while it sags, and a hold where it dips again and again."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.safety.conditions import Condition
from wayfarer.safety.supply import DIPS, DIPS_S, SupplyMonitor, meaning

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
