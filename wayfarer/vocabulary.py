"""The words for each phase, anomaly, level, condition, reason and outcome in a log: one for each name. Pure.

The one place for these words: terminal, journal, live page, Foxglove, reports and ``wayfarer list --conditions`` take
them from here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.phases import PhaseEvent
from wayfarer.safety.conditions import MANUAL_LEVELS, TABLE, Condition, Kind, Level


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
    "ladder.blind_detour": "driven far without seeing the ground, so it drives back, turns at random and drives on",
}

PART_TEXTS: Mapping[str, str] = {  # those whose name in a rover file is not a word for a thing
    "motion": "motion sensor",
    "contact": "bumper",
    "wheels": "wheel sensor",
    "position": "position receiver",
}

LEVEL_TEXTS: Mapping[str, str] = {
    Level.WELL.name.lower(): "No faults",
    Level.NOTE.name.lower(): "Note: continues to drive",
    Level.DEGRADE.name.lower(): "Degraded: drives with limits",
    Level.HOLD.name.lower(): "Wheels held until this clears",
    Level.FAULT.name.lower(): "Fault: stopped until re-armed",
}

# How a run or a trial ended, if its name is not the word for it.
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

# -- conditions ------------------------------------------------------------------------------------------------------

KIND_TEXTS: Mapping[Kind, str] = {
    Kind.DANGER: "wheels may turn without a command, may not stop, or may turn when nobody expects it",
    Kind.IGNORANCE: "a sensor is silent, or its readings are wrong",
    Kind.WEAKNESS: "supply or drive cannot give what is asked for",
    Kind.FOREST: "the ground or an obstacle holds the rover",
    Kind.OPERATOR: "a person asked for it",
}


class Words(NamedTuple):
    """The words for a condition: clauses without a full stop. Times and distances are those of the shipped settings.

    ``what`` is wrong, ``does`` is what the rover does about it ("it ..."), and ``ends_when`` says what must happen for
    that to end. ``cause`` and ``remedy`` are for a person whose rover is not armed because of it.
    """

    what: str
    does: str
    ends_when: str
    cause: str = ""
    remedy: str = ""


_STANDS_FOR_COMPASS = (
    "stops while the compass is opened again; after 3 s it estimates the heading, unless it drives among people"
)
_COMPASS_IS_BACK = "the compass is plausible again, or the heading is estimated"
_BLIND = "drives a stride ahead (3 m, MiniRover 1 m), less if steering turns nothing, then turns away as if stuck"
_SEES = "the motion sensor sees the ground again"
_DISARMS = "stops and disarms"
_ARMED_AGAIN = "somebody arms the rover again"

WORDS: Mapping[Condition, Words] = {
    Condition.COMPASS_STALE: Words("the compass is silent", _STANDS_FOR_COMPASS, _COMPASS_IS_BACK),
    Condition.COMPASS_LOST: Words(
        "the compass has been silent for seconds",
        f"{_DISARMS}; a rover on a mission estimates its heading before that, unless it drives among people",
        f"the compass answers and {_ARMED_AGAIN}",
        cause="a loose wire, or no power",
        remedy="check the compass's wires and power; wayfarer check",
    ),
    Condition.COMPASS_IMPLAUSIBLE: Words("compass readings are implausible", _STANDS_FOR_COMPASS, _COMPASS_IS_BACK),
    Condition.COMPASS_FROZEN: Words(
        "the heading does not change while the rover turns, or no angle while it drives",
        _STANDS_FOR_COMPASS,
        _COMPASS_IS_BACK,
    ),
    Condition.COMPASS_UNCALIBRATED: Words(
        "the compass has lost its calibration",
        "drives on, and does not use the compass for a second after each jump of the heading",
        "the compass reports its calibration again",
    ),
    Condition.HEADING_RECKONED: Words(
        "the compass cannot be used: the heading is estimated from the wheels",
        "drives on with the heading that follows from its wheel commands and the turn response that it has learnt",
        "the compass has been plausible for 1 s",
    ),
    Condition.MOTION_UNKNOWN: Words("the motion sensor's picture is too poor", _BLIND, _SEES),
    Condition.MOTION_STALE: Words(
        "the motion sensor is silent",
        f"{_BLIND}; the sensor is opened again every 2 s",
        _SEES,
        cause="a loose wire, or no power",
        remedy="check the motion sensor's wires and power; wayfarer check",
    ),
    Condition.MOTION_IMPLAUSIBLE: Words(
        "motion readings are implausible", "drives on, and does not use such a reading", "the next reading is plausible"
    ),
    Condition.CONTACT_STALE: Words(
        "the bumper is silent", "drives on without it; the bumper is opened again every 2 s", "the bumper answers"
    ),
    Condition.WHEELS_STALE: Words(
        "the wheel sensor is silent", "drives on without it; the sensor is opened again every 2 s", "it answers"
    ),
    Condition.SLIP_UNSEEN: Words(
        "no sensor shows whether the rover moves: wheels that spin look like driving",
        _BLIND,
        "it has a motion sensor, named in anomaly_source",
    ),
    Condition.OVERTURNED: Words(
        "the rover lies on its side or roof",
        _DISARMS,
        f"it is back on its wheels and {_ARMED_AGAIN}",
        cause="it lies on its side or roof, or its compass is mounted askew",
        remedy="put it on its wheels",
    ),
    Condition.RUNAWAY: Words(
        "the rover moves although its wheels are commanded to stop",
        f"{_DISARMS}; it sends a stop at each tick while it moves",
        _ARMED_AGAIN,
    ),
    Condition.DRIVE_REVERSED: Words(
        "the rover turns in the direction opposite to its commands", _DISARMS, _ARMED_AGAIN
    ),
    Condition.CANNOT_TURN: Words(
        "the rover does not turn on the spot at full duty: the ground or an obstacle holds it",
        "goes on with its algorithm; after twelve failed turns it tries other manoeuvres",
        "it turns on the spot",
    ),
    Condition.ENTRAPPED: Words(
        "the rover makes no progress any more", f"{_DISARMS}, because its rover file has give_up = true", _ARMED_AGAIN
    ),
    Condition.NO_PROGRESS: Words(
        "the rover makes no progress: it tries other manoeuvres",
        "tries other manoeuvres, one after the other, each followed by 10 s of its algorithm",
        "it gets 0.2 m ahead without an anomaly",
    ),
    Condition.RESTING: Words(
        "the rover makes no progress: it rests, so that its motors cool, and tries again",
        "stops for 30 s; each rest without progress is twice as long as the last one, up to 10 minutes",
        "the rest is over",
    ),
    Condition.MOTORS_FAILED: Words(
        "the motor board did not answer, or it had a fault",
        "stops, and opens the board again after 1, 2, 4 s and so on, up to 60 s",
        "the board answers, its deadman is on, it reports no fault, and the light has blinked",
    ),
    Condition.BOARD_DISAGREES: Words(
        "the motor board applies other duties than commanded",
        f"{_DISARMS}; it sends a stop at each tick while the board disagrees",
        _ARMED_AGAIN,
        cause="the motor board applies another duty than commanded",
        remedy="disconnect the motors' battery, check the board's wires and that no other program commands it",
    ),
    Condition.BOARD_SILENT: Words(
        "the motor board does not report its status",
        "drives on without knowing battery and faults",
        "the board reports again",
    ),
    Condition.BATTERY_LOW: Words(
        "the battery is low", "drives on, and reports it", "the battery's voltage is above the limit"
    ),
    Condition.BATTERY_CRITICAL: Words(
        "the battery is almost empty",
        _DISARMS,
        f"the battery is charged or replaced and {_ARMED_AGAIN}",
        cause="the battery is almost empty",
        remedy="charge it or replace it",
    ),
    Condition.UNDERVOLTAGE: Words(
        "the computer's voltage is too low: duty is limited",
        "drives on with at most 0.7 of the allowed duty",
        "the voltage is high enough",
    ),
    Condition.POWER_UNSTABLE: Words(
        "the voltage dips repeatedly, at the computer or the motor board",
        "drives on with at most half of the allowed duty",
        "there were fewer than three dips in the last minute",
        cause="the computer's supply dips again and again",
        remedy="give it a separate 5 V supply",
    ),
    Condition.OPERATOR_HOLD: Words("an operator asked to hold", "stays stopped", "somebody resumes it"),
    Condition.RESUME_WARNING: Words(
        "the rover drives on in a moment: step away",
        "stays stopped for one more second while its light blinks",
        "the second is over",
    ),
    Condition.TICK_LATE: Words(
        "the control tick came late", "stops, because an old decision must not be used", "a tick comes in time"
    ),
    Condition.DECISION_INVALID: Words("the algorithm gave an invalid command", _DISARMS, _ARMED_AGAIN),
}

CONDITION_TEXTS: Mapping[str, str] = {condition.value: words.what for condition, words in WORDS.items()}


class Said(NamedTuple):
    """What a rover does because of a condition, and what must happen for that to end; clauses as in ``Words``."""

    does: str
    ends_when: str


def said_of(condition: Condition, level: Level, *, by_hand: bool = False) -> Said:
    """Return the words for a condition of a rover for which it has this level; ``by_hand``: a person drives it."""
    row, words = TABLE[condition], WORDS[condition]
    obeys = by_hand and level < Level.HOLD and row.kind in {Kind.IGNORANCE, Kind.FOREST}  # no manoeuvre is begun
    if obeys or (level is MANUAL_LEVELS[condition] and level is not row.level):
        return Said("drives as the person commands", words.ends_when)
    if level is row.level:
        return Said(words.does, words.ends_when)
    return Said(_DISARMS, _ARMED_AGAIN) if level is Level.FAULT else Said("stays stopped", words.ends_when)


# -- every name -------------------------------------------------------------------------------------------------------

_ALL: Mapping[str, str] = {
    **PHASE_TEXTS, **ANOMALY_TEXTS, **CONDITION_TEXTS, **PART_TEXTS, **LADDER_TEXTS, **_REASONS,
}  # fmt: skip


def in_words(name: str) -> str:
    """Return the words for the name of a phase, an anomaly, a condition, a part or a reason.

    A name that is unknown is returned as it is: a third party's algorithm or a newer wayfarer may give any.
    """
    return _ALL.get(name, name)


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
    """Return what an armed rover does because of a condition, and until when.

    For example "it stays stopped, until a tick comes in time".

    ``by_hand``: what it does while a person drives. Empty if the names are unknown, as they may be in a log.
    """
    said = _said(level, cause, by_hand=by_hand)
    return "" if said is None else f"it {said.does}, until {said.ends_when}"


def ends_text(level: object, cause: object) -> str:
    """Return what must happen for a condition to end, as a clause; empty if the names are unknown."""
    said = _said(level, cause)
    return "" if said is None else said.ends_when


def _said(level: object, cause: object, *, by_hand: bool = False) -> Said | None:
    try:
        return said_of(Condition(cause), Level[str(level).upper()], by_hand=by_hand)
    except (ValueError, KeyError):
        return None


def health_text(level: str, cause: str | None) -> str:
    """Say how the rover is: a level of health, the name of its cause, and what must happen for that to end."""
    ends = ends_text(level, cause)
    because_of = f": {in_words(cause)}" if cause else ""
    return f"{level_text(level, cause)}{because_of}{f'. This ends when {ends}' if ends else ''}"


def disarmed_text(reason: str) -> str:
    """Return why a rover was disarmed, as ``fault: compass_lost`` or ``mission_time``, with its names in words."""
    what, colon, conditions = reason.partition(": ")
    return f"{outcome_in_words(what)}{colon}{', '.join(map(in_words, conditions.split(', ')))}".replace("_", " ")


def goal_text(goal_heading_deg: float | None) -> str:
    """Say where a rover drives: towards a heading, or straight ahead if it has none."""
    return "straight ahead" if goal_heading_deg is None else f"towards {whole_deg(goal_heading_deg)} degrees"


def whole_deg(angle_deg: float) -> str:
    """Return an angle in whole degrees; 359.7 is north, not 360."""
    return f"{float(f'{angle_deg:.0f}') % 360.0:.0f}"


def met(anomalies: Iterable[str], phase: str | None) -> str:
    """Say which anomalies a rover met, and what it was doing."""
    return f"{' and '.join(map(in_words, anomalies))} while {_clause(in_words(phase or '?'))}"


def because(why: str, anomalies: Collection[str]) -> str:
    """Return what began a phase, given the ``why`` of its first tick and the anomalies in it."""
    phase, _, event = why.partition(".")
    if anomalies and event == PhaseEvent.ANOMALY.value:
        return met(anomalies, phase)
    return ", ".join(filter(None, map(in_words, [why, *anomalies])))
