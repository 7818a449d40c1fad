"""The safety case: no row without a hazard, a mechanism, a test that there is, and a word of what remains."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.safety_case import BEYOND, CASES, EVENTS, HAZARDS, Case, page, scenarios
from wayfarer.control.modes import Event
from wayfarer.safety.conditions import Condition

TESTS = Path(__file__).parents[1]
ROWS = [each.tests for each in [*CASES.values(), *EVENTS.values()]] + [each.tests for each in BEYOND]


def test_every_condition_and_every_event_has_a_case_and_a_row() -> None:
    assert (list(CASES), list(EVENTS)) == (list(Condition), list(Event))
    assert len(re.findall("^[|] [A-Z]", page(), re.MULTILINE)) == len(ROWS)


@pytest.mark.parametrize("condition", Condition, ids=[each.value for each in Condition])
def test_every_condition_has_a_test_and_something_that_remains(condition: Condition) -> None:
    case = CASES[condition]
    assert [*scenarios(condition), *case.tests]
    assert case.hazard in HAZARDS
    assert case.remains


@pytest.mark.parametrize("case", EVENTS.values(), ids=[each.name for each in EVENTS])
def test_every_event_has_a_hazard_a_test_and_something_that_remains(case: Case) -> None:
    assert all(case)
    assert case.hazard in HAZARDS


@pytest.mark.parametrize("row", BEYOND, ids=[each.cause for each in BEYOND])
def test_every_row_beyond_the_conditions_is_whole(row: tuple[object, ...]) -> None:
    assert all(row)
    assert row[0] in HAZARDS


@pytest.mark.parametrize("name", sorted({name for names in ROWS for name in names}))
def test_each_test_that_is_named_is_there(name: str) -> None:
    file, _, function = name.partition("::")
    assert re.search(rf"^(async def|def|class) {function}\(", (TESTS / file).read_text(encoding="utf-8"), re.MULTILINE)
