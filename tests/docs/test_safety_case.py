"""The safety case: no row without a hazard, a mechanism, a test that there is, and a word of what remains."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.safety_case import BEYOND, CASES, HAZARDS, page, scenarios
from wayfarer.safety.conditions import Condition

TESTS = Path(__file__).parents[1]
NAMED = {each.value: CASES[each].tests for each in CASES} | {each.cause: each.tests for each in BEYOND}


def test_every_condition_has_a_case_and_a_row() -> None:
    assert list(CASES) == list(Condition)
    assert len(re.findall("^[|] [A-Z]", page(), re.MULTILINE)) == len(CASES) + len(BEYOND)


@pytest.mark.parametrize("condition", Condition, ids=[each.value for each in Condition])
def test_every_condition_has_a_test_and_something_that_remains(condition: Condition) -> None:
    case = CASES[condition]
    assert [*scenarios(condition), *case.tests]
    assert case.hazard in HAZARDS
    assert case.remains


@pytest.mark.parametrize("row", BEYOND, ids=[each.cause for each in BEYOND])
def test_every_row_beyond_the_conditions_is_whole(row: tuple[object, ...]) -> None:
    assert all(row)
    assert row[0] in HAZARDS


@pytest.mark.parametrize("name", [name for names in NAMED.values() for name in names])
def test_each_test_that_is_named_is_there(name: str) -> None:
    file, _, function = name.partition("::")
    assert re.search(rf"^(async )?def {function}\(", (TESTS / file).read_text(encoding="utf-8"), re.MULTILINE)
