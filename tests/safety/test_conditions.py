"""The table of conditions: what follows from its columns, and that each has words that fit everywhere."""

from __future__ import annotations

import pytest

from wayfarer.safety.conditions import (
    HOLDING_LEVELS,
    LEVELS,
    MANUAL_LEVELS,
    NOT_ARMED,
    NOT_DRIVEN,
    TABLE,
    Condition,
    Kind,
    Level,
    Means,
)
from wayfarer.vocabulary import KIND_TEXTS, WORDS, Words, said_of


def test_every_condition_has_a_row_and_words() -> None:
    assert list(TABLE) == list(LEVELS) == list(WORDS) == list(Condition)
    assert set(KIND_TEXTS) == set(Kind)


@pytest.mark.parametrize("words", WORDS.values(), ids=[each.value for each in WORDS])
def test_words_are_clauses_that_a_sentence_can_take(words: Words) -> None:
    for clause in (words.what, words.does, words.ends_when):
        assert clause
        assert clause == clause.strip(". ")
        assert clause[0].islower()


def test_only_a_person_ends_a_latched_fault_and_only_that() -> None:
    for condition, words in WORDS.items():
        assert ("somebody arms" in words.ends_when) is (LEVELS[condition] is Level.FAULT), condition


def test_who_cannot_arm_is_told_why_and_what_to_do_and_nobody_else() -> None:
    for condition, words in WORDS.items():
        assert bool(words.cause) is bool(words.remedy) is (condition in NOT_ARMED), condition


def test_what_a_person_sees_stops_nobody_who_drives_by_hand() -> None:
    """Ignorance and the forest, that is; what they cannot see or help is as severe as ever."""
    for condition, row in TABLE.items():
        most = {Kind.IGNORANCE: Level.DEGRADE, Kind.FOREST: Level.NOTE}.get(row.kind, row.level)
        assert MANUAL_LEVELS[condition] == min(row.level, most), condition
    assert {
        Condition.OVERTURNED,
        Condition.BOARD_DISAGREES,
        Condition.BATTERY_CRITICAL,
    } == NOT_DRIVEN


def test_among_people_nothing_is_less_severe_and_what_blinds_holds() -> None:
    for condition, row in TABLE.items():
        stricter = Means.STRICTER_AMONG_PEOPLE in row.means
        assert HOLDING_LEVELS[condition] - row.level == stricter, condition
        assert HOLDING_LEVELS[condition] >= Level.HOLD or not stricter


def test_rover_that_a_person_drives_is_not_said_to_begin_a_manoeuvre() -> None:
    manoeuvres = {Condition.MOTION_STALE, Condition.DRIVE_REVERSED, Condition.CANNOT_TURN, Condition.COMPASS_LOST}
    for condition in manoeuvres:
        assert said_of(condition, MANUAL_LEVELS[condition], by_hand=True).does == "drives as the person commands"
    for condition in (Condition.TICK_LATE, Condition.UNDERVOLTAGE, Condition.BATTERY_CRITICAL):
        assert said_of(condition, MANUAL_LEVELS[condition], by_hand=True).does == WORDS[condition].does
