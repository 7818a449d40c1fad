"""The table of conditions: complete, in words that fit everywhere, and the one of the documentation."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.safety.conditions_page import HEAD, rows
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.responses import HOLDING_LEVELS, LEVELS, MANUAL_LEVELS, RESPONSES, Response, said_of

PAGE = Path(__file__).parents[2] / "docs" / "explanation" / "what-stops-the-wheels.md"


def test_every_condition_has_a_row() -> None:
    assert set(RESPONSES) == set(LEVELS) == set(HOLDING_LEVELS) == set(Condition)


@pytest.mark.parametrize("row", RESPONSES.values(), ids=[each.value for each in RESPONSES])
def test_words_are_clauses_that_a_sentence_can_take(row: Response) -> None:
    for clause in (row.what, row.does, row.ends_when):
        assert clause
        assert clause == clause.strip(". ")
        assert clause[0].islower()


def test_only_a_person_ends_a_latched_fault_and_only_that() -> None:
    for condition, row in RESPONSES.items():
        assert ("somebody arms" in row.ends_when) is (row.level is Level.FAULT), condition


def test_rover_that_a_person_drives_is_not_said_to_begin_a_manoeuvre() -> None:
    manoeuvres = {Condition.MOTION_GONE, Condition.DRIVE_REVERSED, Condition.CANNOT_TURN, Condition.COMPASS_LOST}
    for condition in manoeuvres:
        assert said_of(condition, MANUAL_LEVELS[condition], by_hand=True).does == "drives as the person wants"
    for condition in (Condition.TICK_LATE, Condition.UNDERVOLTAGE, Condition.BATTERY_CRITICAL):
        assert said_of(condition, MANUAL_LEVELS[condition], by_hand=True).does == RESPONSES[condition].does


def test_documentation_has_the_table() -> None:
    """``python -m tests.safety.conditions_page`` prints it again."""
    text = PAGE.read_text(encoding="utf-8").partition("<!-- conditions -->\n")[2].partition("\n<!-- /conditions -->")[0]
    assert text == "\n".join([HEAD, *rows()])
