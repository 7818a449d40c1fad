"""Every name that the log may hold has words for people."""

from __future__ import annotations

import pytest

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.phases import WHY
from wayfarer.escape.recovery import BLIND_DETOUR, RUNGS
from wayfarer.safety.conditions import Condition, Level
from wayfarer.vocabulary import (
    ANOMALY_TEXTS,
    CONDITION_TEXTS,
    LADDER_TEXTS,
    LEVEL_TEXTS,
    PART_TEXTS,
    PHASE_TEXTS,
    because,
    disarmed_text,
    ends_text,
    in_words,
    level_text,
    response_text,
)


def test_every_phase_anomaly_level_and_condition_has_words() -> None:
    assert set(PHASE_TEXTS) == {phase.value for phase in Phase}
    assert set(ANOMALY_TEXTS) == {anomaly.value for anomaly in Anomaly}
    assert set(LEVEL_TEXTS) == {level.name.lower() for level in Level}
    assert set(CONDITION_TEXTS) == {condition.value for condition in Condition}
    assert set(LADDER_TEXTS) == {rung.name for rung in (*RUNGS, BLIND_DETOUR)}


def test_no_name_means_two_things() -> None:
    tables = (PHASE_TEXTS, ANOMALY_TEXTS, CONDITION_TEXTS, PART_TEXTS, LADDER_TEXTS)
    assert all(in_words(name) == text for table in tables for name, text in table.items())


def test_every_reason_is_a_whole_text_of_its_own() -> None:
    told = {why: in_words(why) for why in WHY.values()}
    assert not any("{" in text or text == why for why, text in told.items())
    assert len(set(told.values())) >= len(told) - 2 * (len(Phase) - 1), "only C and the heading name no phase"


def test_anomaly_says_what_it_was() -> None:
    assert because("probe.anomaly", ["nose_up", "touched"]) == "nose up and touching something while probing in a curve"
    assert because("probe.anomaly", []) == "anomaly while probing in a curve"


def test_what_a_third_party_calls_a_reason_is_told_as_it_is() -> None:
    for why in ("spiral.out", "", "probe.dizzy", "a.b.c"):
        assert because(why, []) == why
    assert because("spiral.out", ["nose_up"]) == "spiral.out, nose up"
    assert because("follow.anomaly", ["wet"]) == "wet while following the goal"


def test_hold_that_a_person_asked_for_ends_with_resume_and_any_other_by_itself() -> None:
    assert level_text("hold", Condition.OPERATOR_HOLD.value) == "Wheels held until Resume"
    assert level_text("hold", Condition.COMPASS_STALE.value) == "Wheels held until this clears"
    assert level_text("well", None) == "No faults"
    assert level_text("made up", None) == "made up"


def test_response_says_what_the_rover_does_and_until_when() -> None:
    assert response_text("hold", "tick_late") == (
        "it stops, because an old decision must not be used, until a tick comes in time"
    )
    assert ends_text("hold", "tick_late") == "a tick comes in time"


def test_response_of_a_rover_among_people_is_another_one() -> None:
    assert response_text("degrade", "motion_stale").startswith("it drives a stride ahead")
    assert response_text("fault", "motors_failed") == "it stops and disarms, until somebody arms the rover again"
    assert response_text("hold", "motion_stale") == "it stays stopped, until the motion sensor sees the ground again"


@pytest.mark.parametrize(("level", "cause"), [("hold", "made up"), ("made up", "tick_late"), (None, None), (3, ["x"])])
def test_names_of_another_version_have_no_response(level: object, cause: object) -> None:
    assert response_text(level, cause) == ends_text(level, cause) == ""


def test_reason_to_disarm_names_conditions_in_words() -> None:
    assert disarmed_text("fault: compass_lost") == f"fault: {CONDITION_TEXTS['compass_lost']}"
    assert disarmed_text("not armed: overturned, motion_stale") == (
        f"not armed: {CONDITION_TEXTS['overturned']}, {CONDITION_TEXTS['motion_stale']}"
    )
    assert disarmed_text("requested by a person") == "requested by a person"
