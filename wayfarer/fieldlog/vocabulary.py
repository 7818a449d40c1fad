"""What the names of phases, anomalies, levels and conditions in a log mean, in words for people. Pure.

The one place for these words, with ``safety.responses``, which has those of the conditions: terminal, journal, live
page, Foxglove and reports take them from here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.phases import PhaseEvent
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.responses import RESPONSES, Said, said_of

PHASE_TEXTS: Mapping[str, str] = {
    Phase.FOLLOW.value: "Follows the goal heading",
    Phase.BACK_OFF.value: "Backs off",
    Phase.TURN_AWAY.value: "Turns away",
    Phase.PROBE.value: "Probes: drives ahead in a curve",
    Phase.STRIDE.value: "Drives straight ahead",
    Phase.HALT.value: "Stopped",
}

_WHILE: Mapping[str, str] = {
    Phase.FOLLOW.value: "on its way to the goal",
    Phase.BACK_OFF.value: "while backing off",
    Phase.TURN_AWAY.value: "while turning away",
    Phase.PROBE.value: "while probing",
    Phase.STRIDE.value: "while driving straight ahead",
    Phase.HALT.value: "while stopped",
}

_AFTER: Mapping[str, str] = {
    Phase.FOLLOW.value: "the goal heading was followed",
    Phase.BACK_OFF.value: "the back-off was done",
    Phase.TURN_AWAY.value: "the turn was done",
    Phase.PROBE.value: "the probe was driven",
    Phase.STRIDE.value: "the straight stretch was driven",
    Phase.HALT.value: "it was stopped",
}

PHASE_EVENT_TEXTS: Mapping[str, str] = {
    PhaseEvent.ANOMALY.value: "there was an anomaly {during}",
    PhaseEvent.DONE.value: "{after}",
    PhaseEvent.UNWOUND.value: "the turn counter C is back at zero",
    PhaseEvent.REALIGNED.value: "the heading is the goal heading again",
    PhaseEvent.EXHAUSTED.value: "it took too long {during}",
    PhaseEvent.OVERWOUND.value: "C exceeded three turns {during} and was reset",
}

LADDER_TEXTS: Mapping[str, str] = {
    "ladder.other_side": "no progress: it tries the other side",
    "ladder.full_duty": "no progress: it tries full duty",
    "ladder.rock": "no progress: it rocks ahead and back",
    "ladder.long_back": "no progress: it goes a long way back",
    "ladder.random_turn": "no progress: it tries a random turn",
    "ladder.blind_detour": "driven long without sight: it drives back, turns at random and drives on",
}

ANOMALY_TEXTS: Mapping[str, str] = {
    Anomaly.IMMOBILISED.value: "stalled",
    Anomaly.NOSE_UP.value: "nose up",
    Anomaly.NOSE_DOWN.value: "nose down",
    Anomaly.RIGHT_DOWN.value: "right side down",
    Anomaly.LEFT_DOWN.value: "left side down",
    Anomaly.TOUCHED.value: "touches something",
}

_MET: Mapping[str, str] = {
    Anomaly.IMMOBILISED.value: "it stalled",
    Anomaly.NOSE_UP.value: "its nose was up",
    Anomaly.NOSE_DOWN.value: "its nose was down",
    Anomaly.RIGHT_DOWN.value: "its right side was down",
    Anomaly.LEFT_DOWN.value: "its left side was down",
    Anomaly.TOUCHED.value: "it touched something",
}

PART_TEXTS: Mapping[str, str] = {  # those whose name in a rover file is no word for a thing
    "motion": "motion sensor",
    "contact": "bumper",
    "position": "position receiver",
}

LEVEL_TEXTS: Mapping[str, str] = {
    Level.WELL.name.lower(): "No faults",
    Level.NOTE.name.lower(): "Note: continues to drive",
    Level.DEGRADE.name.lower(): "Degraded: drives with limits",
    Level.HOLD.name.lower(): "Wheels held until this clears",
    Level.FAULT.name.lower(): "Fault: stopped until re-armed",
}

CAUSE_TEXTS: Mapping[str, str] = {condition.value: row.what for condition, row in RESPONSES.items()}


def level_text(level: str, cause: str | None) -> str:
    """Return what a level of health means for the wheels, given the name of its cause, if there is one.

    A name that is unknown is returned as it is.
    """
    if cause == Condition.OPERATOR_HOLD.value:
        return "Wheels held until Resume"
    return LEVEL_TEXTS.get(level, level)


def response_text(level: object, cause: object) -> str:
    """Return what an armed rover does because of a condition, and until when: "it stands, until a tick comes in time".

    Empty where the names are unknown, as they may be in a log.
    """
    said = _said(level, cause)
    return "" if said is None else f"it {said.does}, until {said.ends_when}"


def ends_text(level: object, cause: object) -> str:
    """Return what must happen for a condition to end, as a clause; empty where the names are unknown."""
    said = _said(level, cause)
    return "" if said is None else said.ends_when


def _said(level: object, cause: object) -> Said | None:
    try:
        return said_of(Condition(cause), Level[str(level).upper()])
    except (ValueError, KeyError):
        return None


def disarmed_text(reason: str) -> str:
    """Return why a rover was disarmed, as ``fault: compass_lost``, with its conditions in words."""
    what, colon, conditions = reason.partition(": ")
    return f"{what}{colon}{', '.join(CAUSE_TEXTS.get(each, each) for each in conditions.split(', '))}"


def met(anomalies: Iterable[str], phase: str | None) -> str:
    """Say which anomalies a rover met and what it did then; names that are unknown as they are."""
    told = " and ".join(_MET.get(anomaly, f"it met {anomaly}") for anomaly in anomalies)
    return f"{told} {_WHILE.get(phase or '', f'in {phase}')}"


def because(why: str, anomalies: Iterable[str]) -> str:
    """Return what began a phase, given the ``why`` of its first tick, as ``probe.anomaly``, and what was wrong then.

    A third party's algorithm may give any other text: it is returned as it is.
    """
    if why in LADDER_TEXTS:
        return LADDER_TEXTS[why]
    phase, _, event = why.partition(".")
    if phase not in _WHILE or event not in PHASE_EVENT_TEXTS:
        return why
    found = tuple(anomalies)
    if event == PhaseEvent.ANOMALY.value and found:
        return met(found, phase)
    return PHASE_EVENT_TEXTS[event].format(during=_WHILE[phase], after=_AFTER[phase])
