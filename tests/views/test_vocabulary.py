"""Every name that the log may hold has words for people."""

from __future__ import annotations

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.phases import WHY
from wayfarer.safety.conditions import Condition, Level
from wayfarer.views.vocabulary import ANOMALIES, CAUSES, LEVELS, PHASES, because, level_text, reason_text


def test_every_phase_anomaly_level_and_condition_has_words() -> None:
    assert set(PHASES) == {phase.value for phase in Phase}
    assert set(ANOMALIES) == {anomaly.value for anomaly in Anomaly}
    assert set(LEVELS) == {level.name.lower() for level in Level}
    assert set(CAUSES) == {condition.value for condition in Condition}


def test_every_reason_is_a_whole_text_of_its_own() -> None:
    told = {why: because(why, ()) for why in WHY.values()}
    assert not any("{" in text or text == why for why, text in told.items())
    assert len(set(told.values())) >= len(told) - 2 * (len(Phase) - 1), "only C and the heading name no phase"


def test_anomaly_says_what_it_was() -> None:
    assert because("probe.anomaly", ["nose_up", "touched"]) == "nose up, touches something, while probing"
    assert because("probe.anomaly", []) == "an anomaly while probing"


def test_what_a_third_party_calls_a_reason_is_told_as_it_is() -> None:
    for why in ("spiral.out", "", "probe", "probe.dizzy", "a.b.c"):
        assert because(why, ["immobilised"]) == why
    assert because("follow.anomaly", ["wet"]) == "wet, on its way to the goal"


def test_hold_that_a_person_asked_for_ends_with_resume_and_any_other_by_itself() -> None:
    assert level_text("hold", Condition.OPERATOR_HOLD.value) == "Wheels held until Resume"
    assert level_text("hold", Condition.COMPASS_STALE.value) == "Wheels held until this clears"
    assert level_text("well", None) == "No faults"
    assert level_text("made up", None) == "made up"


def test_reason_to_disarm_names_conditions_in_words() -> None:
    assert reason_text("fault: compass_lost") == f"fault: {CAUSES['compass_lost']}"
    assert reason_text("not armed: overturned, motion_gone") == (
        f"not armed: {CAUSES['overturned']}, {CAUSES['motion_gone']}"
    )
    assert reason_text("requested by a person") == "requested by a person"
