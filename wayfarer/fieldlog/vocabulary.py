"""The words for each phase, anomaly, level, condition, reason and outcome in a log: one for each name. Pure.

The one place for these words, with ``safety.responses``, which has those of the conditions: terminal, journal, live
page, Foxglove and reports take them from here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.phases import PhaseEvent
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.responses import RESPONSES, Said, said_of


def _clause(text: str) -> str:
    """Return a label as a part of a sentence."""
    return text[:1].lower() + text[1:]


# What the rover is doing. With a small letter they also follow "while" and "finished" (``_EVENT_TEXTS``).
PHASE_TEXTS: Mapping[str, str] = {
    Phase.FOLLOW.value: "Following the goal",
    Phase.BACK_OFF.value: "Backing off",
    Phase.TURN_AWAY.value: "Turning away",
    Phase.PROBE.value: "Probing in a curve",
    Phase.STRIDE.value: "Driving straight ahead",
    Phase.HALT.value: "Standing",
    Phase.MANUAL.value: "Driven by hand",
}

# What the rover is, while it is in a phase: "nose up while backing off".
ANOMALY_TEXTS: Mapping[str, str] = {
    Anomaly.IMMOBILISED.value: "stalled",
    Anomaly.NOSE_UP.value: "nose up",
    Anomaly.NOSE_DOWN.value: "nose down",
    Anomaly.RIGHT_DOWN.value: "right side down",
    Anomaly.LEFT_DOWN.value: "left side down",
    Anomaly.TOUCHED.value: "touching something",
}

_EVENT_TEXTS: Mapping[str, str] = {
    PhaseEvent.ANOMALY.value: "anomaly while {phase}",
    PhaseEvent.DONE.value: "finished {phase}",
    PhaseEvent.UNWOUND.value: "the turn counter C is back at zero",
    PhaseEvent.REALIGNED.value: "the heading is the goal heading again",
    PhaseEvent.EXHAUSTED.value: "took too long {phase}",
    PhaseEvent.OVERWOUND.value: "C exceeded three turns while {phase} and was reset",
}

LADDER_TEXTS: Mapping[str, str] = {
    "ladder.other_side": "no progress, so it tries the other side",
    "ladder.full_duty": "no progress, so it tries full duty",
    "ladder.rock": "no progress, so it rocks ahead and back",
    "ladder.long_back": "no progress, so it goes a long way back",
    "ladder.random_turn": "no progress, so it tries a random turn",
    "ladder.shuffle": "no progress, so it shuffles to the side",
    "ladder.blind_detour": "driven long without sight, so it drives back, turns at random and drives on",
}

CONDITION_TEXTS: Mapping[str, str] = {condition.value: row.what for condition, row in RESPONSES.items()}

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

# How a run or a trial ended, where its name is not the word for it.
OUTCOME_TEXTS: Mapping[str, str] = {
    "left_bounds": "left the map",
    "mission_time": "time limit",
    "mission_distance": "distance limit",
    "mission_radius": "radius limit",
}

# Why a phase ended, as ``why`` of the tick after it names it: ``probe.unwound``.
_REASONS: Mapping[str, str] = {
    f"{phase}.{event}": text.format(phase=_clause(doing))
    for phase, doing in PHASE_TEXTS.items()
    for event, text in _EVENT_TEXTS.items()
}

_WORDS: Mapping[str, str] = {
    **PHASE_TEXTS, **ANOMALY_TEXTS, **CONDITION_TEXTS, **PART_TEXTS, **LADDER_TEXTS, **_REASONS,
}  # fmt: skip


def in_words(name: str) -> str:
    """Return the words for the name of a phase, an anomaly, a condition, a part or a reason.

    A name that is unknown is returned as it is: a third party's algorithm or a newer wayfarer may give any.
    """
    return _WORDS.get(name, name)


def outcome_in_words(name: str) -> str:
    """Return the word for how a run or a trial ended; a name that is unknown is returned as it is."""
    return OUTCOME_TEXTS.get(name, name)


def level_text(level: str, cause: str | None) -> str:
    """Return what a level of health means for the wheels, given the name of its cause, if there is one.

    A name that is unknown is returned as it is.
    """
    if cause == Condition.OPERATOR_HOLD.value:
        return "Wheels held until Resume"
    return LEVEL_TEXTS.get(level, level)


def response_text(level: object, cause: object, *, by_hand: bool = False) -> str:
    """Return what an armed rover does because of a condition, and until when: "it stands, until a tick comes in time".

    ``by_hand``: what it does while a person drives. Empty where the names are unknown, as they may be in a log.
    """
    said = _said(level, cause, by_hand=by_hand)
    return "" if said is None else f"it {said.does}, until {said.ends_when}"


def ends_text(level: object, cause: object) -> str:
    """Return what must happen for a condition to end, as a clause; empty where the names are unknown."""
    said = _said(level, cause)
    return "" if said is None else said.ends_when


def _said(level: object, cause: object, *, by_hand: bool = False) -> Said | None:
    try:
        return said_of(Condition(cause), Level[str(level).upper()], by_hand=by_hand)
    except (ValueError, KeyError):
        return None


def disarmed_text(reason: str) -> str:
    """Return why a rover was disarmed, as ``fault: compass_lost`` or ``mission_time``, with its names in words."""
    what, colon, conditions = reason.partition(": ")
    return f"{outcome_in_words(what)}{colon}{', '.join(map(in_words, conditions.split(', ')))}"


def met(anomalies: Iterable[str], phase: str | None) -> str:
    """Say which anomalies a rover met, and what it was doing."""
    return f"{' and '.join(map(in_words, anomalies))} while {_clause(in_words(phase or '?'))}"


def because(why: str, anomalies: Collection[str]) -> str:
    """Return what began a phase, given the ``why`` of its first tick and the anomalies in it."""
    phase, _, event = why.partition(".")
    if anomalies and event == PhaseEvent.ANOMALY.value:
        return met(anomalies, phase)
    return ", ".join(filter(None, map(in_words, [why, *anomalies])))
