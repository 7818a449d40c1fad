"""What the names of phases, anomalies, levels and conditions in a log mean, in words for people. Pure.

The one place for these words: terminal, journal, live page, Foxglove and reports take them from here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.phases import PhaseEvent
from wayfarer.safety.conditions import Condition, Level

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

CAUSE_TEXTS: Mapping[str, str] = {
    Condition.COMPASS_STALE.value: "the compass is silent",
    Condition.COMPASS_LOST.value: "the compass has been silent for seconds",
    Condition.COMPASS_IMPLAUSIBLE.value: "compass readings are implausible",
    Condition.COMPASS_FROZEN.value: "the heading does not change while the rover turns",
    Condition.COMPASS_UNCALIBRATED.value: "the compass has lost its calibration",
    Condition.HEADING_RECKONED.value: "the compass cannot be believed: the heading is reckoned from the wheels",
    Condition.MOTION_STALE.value: "the motion sensor is silent",
    Condition.MOTION_UNKNOWN.value: "the motion sensor's picture is too poor",
    Condition.MOTION_LOST.value: "the motion sensor's picture has been too poor for seconds",
    Condition.MOTION_GONE.value: "the motion sensor has been silent for seconds",
    Condition.MOTION_IMPLAUSIBLE.value: "motion readings are implausible",
    Condition.CONTACT_STALE.value: "the bumper is silent",
    Condition.OVERTURNED.value: "the rover lies on its side or roof",
    Condition.RUNAWAY.value: "the rover moves although its wheels are commanded to stop",
    Condition.DRIVE_ASYMMETRY.value: "the rover does not turn as its wheels are commanded",
    Condition.DRIVE_FAILED.value: "repeatedly, the rover did not turn as its wheels were commanded",
    Condition.CANNOT_TURN.value: "the rover does not turn on the spot at full duty: the ground or an obstacle holds it",
    Condition.ENTRAPPED.value: "the rover makes no progress any more",
    Condition.NO_PROGRESS.value: "the rover makes no progress: it tries other manoeuvres",
    Condition.RESTING.value: "the rover makes no progress: it rests, so that its motors cool, and tries again",
    Condition.MOTORS_FAILED.value: "the motors did not answer",
    Condition.BOARD_FAULT.value: "the motor board reports a fault",
    Condition.BOARD_DISAGREES.value: "the motor board applies other duties than commanded",
    Condition.BOARD_SILENT.value: "the motor board does not report its status",
    Condition.BATTERY_LOW.value: "the battery is low",
    Condition.BATTERY_CRITICAL.value: "the battery is almost empty",
    Condition.UNDERVOLTAGE.value: "the computer's voltage is too low: duty is limited",
    Condition.POWER_UNSTABLE.value: "the computer's voltage dips repeatedly",
    Condition.OPERATOR_HOLD.value: "an operator asked to hold",
    Condition.RESUME_WARNING.value: "the rover drives on in a moment: step away",
    Condition.TICK_LATE.value: "the control tick came late",
    Condition.DECISION_INVALID.value: "the algorithm gave an invalid command",
}


def level_text(level: str, cause: str | None) -> str:
    """Return what a level of health means for the wheels, given the name of its cause, if there is one.

    A name that is unknown is returned as it is.
    """
    if cause == Condition.OPERATOR_HOLD.value:
        return "Wheels held until Resume"
    return LEVEL_TEXTS.get(level, level)


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
