"""When Pledge drives in the place of the plan, and that it gets all the contacts that it needs."""

from __future__ import annotations

from itertools import groupby

from hypothesis import given
from hypothesis import strategies as st

from wayfarer.escape.memory.fallback import CONTACTS, CROWDED, FREE, PROGRESS, Fallback

WIDTH_M = 0.4
APART_M = 10.0 * WIDTH_M


def fallback(budget: float = 10.0) -> Fallback:
    return Fallback(WIDTH_M, budget)


def drivers(chosen: Fallback, contacts: int, apart_m: float = APART_M) -> list[bool]:
    """Who drives on from each contact: True is Pledge."""
    found = []
    for contact in range(contacts):
        chosen.meet(contact * apart_m)
        found.append(chosen.pledge)
    return found


def stints(found: list[bool]) -> list[tuple[bool, int]]:
    return [(pledge, len(list(each))) for pledge, each in groupby(found)]


def test_plan_and_pledge_take_turns_and_their_budgets_double() -> None:
    found = stints(drivers(fallback(10.0), 160))
    assert found[:4] == [(False, 10), (True, 11), (False, 21), (True, 21)]
    assert found[4] == (False, 41)


def meets(chosen: Fallback, path_m: float) -> bool:
    chosen.meet(path_m)
    return chosen.pledge


def test_progress_begins_again_with_the_first_budget() -> None:
    chosen = fallback(10.0)
    chosen.advance(0.0)
    drivers(chosen, 25)
    chosen.advance(PROGRESS * WIDTH_M + 0.01)
    found = stints([meets(chosen, path_m) for path_m in range(1000, 1200, 4)])
    assert found[:2] == [(False, 10), (True, 11)]


def test_less_than_progress_and_a_place_that_was_reached_before_change_nothing() -> None:
    chosen = fallback(10.0)
    chosen.advance(5.0)
    drivers(chosen, 11)
    chosen.advance(5.0 + PROGRESS * WIDTH_M - 0.01)
    chosen.advance(-3.0)
    chosen.advance(5.0)
    assert drivers(chosen, 5) == [True] * 5


def test_reset_begins_with_the_plan() -> None:
    chosen = fallback(10.0)
    drivers(chosen, 15)
    chosen.reset()
    assert not chosen.pledge
    assert stints(drivers(chosen, 25))[0] == (False, 10)


def test_pledge_drives_in_a_crowd_until_the_contacts_are_far_apart() -> None:
    chosen = fallback(1000.0)
    crowded_m, between_m, free_m = (CROWDED - 0.5) * WIDTH_M, (CROWDED + FREE) / 2 * WIDTH_M, (FREE + 0.5) * WIDTH_M
    assert drivers(chosen, CONTACTS + 1, crowded_m) == [False] * (CONTACTS - 1) + [True] * 2
    path_m = CONTACTS * crowded_m
    for apart_m, pledge in ((between_m, True), (free_m, False), (between_m, False)):
        for _ in range(CONTACTS):
            path_m += apart_m
            chosen.meet(path_m)
        assert chosen.pledge is pledge


@given(st.integers(1, 400), st.integers(1, 100), st.floats(0.01, 5.0))
def test_pledge_gets_as_many_contacts_as_it_needs_before_some_times_as_many_were_met(
    needed: int, budget: int, apart_m: float
) -> None:
    """Without progress: stints before it have 6 N, itself N; the first budget, and one contact more for each stint."""
    limit = 7 * needed + 4 * budget + 2 * needed.bit_length() + 4
    found = drivers(fallback(float(budget)), limit, apart_m)
    assert max((length for pledge, length in stints(found) if pledge), default=0) >= needed
