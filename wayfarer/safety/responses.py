"""What the rover does about each condition, how severe it is, and what ends it: one table, the most severe row wins.

``wayfarer list --conditions``, the status, the viewers and the page what-stops-the-wheels.md take words from here.
The times and distances in them are those of the shipped settings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum
from typing import Final, NamedTuple

from wayfarer.safety.conditions import Condition, Level


class Kind(Enum):
    """Why a condition is one; ``meaning`` says it in words."""

    DANGER = "danger"
    IGNORANCE = "ignorance"
    WEAKNESS = "weakness"
    FOREST = "forest"
    OPERATOR = "operator"

    @property
    def meaning(self) -> str:
        """Return what the conditions of this kind have in common."""
        return _MEANINGS[self]


_MEANINGS: Final[Mapping[Kind, str]] = {
    Kind.DANGER: "wheels may turn unasked, may not stop, or may turn when nobody expects it",
    Kind.IGNORANCE: "a sense is silent, or cannot be believed",
    Kind.WEAKNESS: "supply or drive cannot give what is asked for",
    Kind.FOREST: "the ground or an obstacle holds the rover",
    Kind.OPERATOR: "a person asked for it",
}


class Response(NamedTuple):
    """A row of the table.

    ``what`` is wrong, ``does`` is what the rover does about it ("it ..."), and ``ends_when`` says what must happen for
    that to end: clauses without a full stop. ``among_people`` is the level of a rover with ``on_lost_sense = "hold"``
    where it is another one; ``level_among_people`` is its level in any case. ``manual`` is the level while a person
    drives, where it is another one than ``level``: they see what the rover does not.
    """

    level: Level
    kind: Kind
    what: str
    does: str
    ends_when: str
    among_people: Level | None = None
    manual: Level | None = None

    @property
    def level_among_people(self) -> Level:
        """Return the level of a rover that drives among people."""
        return self.level if self.among_people is None else self.among_people


_STANDS_FOR_COMPASS: Final = (
    "stands while the compass is opened again; after 3 s it reckons the heading, unless it drives among people"
)
_COMPASS_IS_BACK: Final = "the compass is believed again, or the heading is reckoned"
_BLIND: Final = (
    "drives a stride ahead (3 m, MiniRover 1 m), less if steering turns nothing, then turns away as if stuck"
)
_BLIND_AND_SILENT: Final = f"{_BLIND}; the sensor is opened again every 2 s"
_SEES: Final = "the motion sensor sees the ground again"
_DISARMS: Final = "stops and disarms"
_ARMED_AGAIN: Final = "somebody arms the rover again"
_OPENS_BOARD: Final = "stands, and opens the board again after 1, 2, 4 s and so on, up to 60 s"
_BOARD_IS_BACK: Final = "the board answers, its deadman is on, it reports no fault, and the light has blinked"

# fmt: off
RESPONSES: Final[Mapping[Condition, Response]] = {
    Condition.COMPASS_STALE: Response(
        Level.HOLD, Kind.IGNORANCE, "the compass is silent", _STANDS_FOR_COMPASS, _COMPASS_IS_BACK,
        manual=Level.DEGRADE),
    Condition.COMPASS_LOST: Response(
        Level.FAULT, Kind.IGNORANCE, "the compass has been silent for seconds",
        f"{_DISARMS}; a rover on a mission reckons its heading before that, unless it drives among people",
        f"the compass answers and {_ARMED_AGAIN}", manual=Level.DEGRADE),
    Condition.COMPASS_IMPLAUSIBLE: Response(
        Level.HOLD, Kind.IGNORANCE, "compass readings are implausible", _STANDS_FOR_COMPASS, _COMPASS_IS_BACK,
        manual=Level.DEGRADE),
    Condition.COMPASS_FROZEN: Response(
        Level.HOLD, Kind.IGNORANCE, "the heading does not change while the rover turns",
        _STANDS_FOR_COMPASS, _COMPASS_IS_BACK, manual=Level.DEGRADE),
    Condition.COMPASS_UNCALIBRATED: Response(
        Level.DEGRADE, Kind.IGNORANCE, "the compass has lost its calibration",
        "drives on, and does not believe the compass for a second after each jump of the heading",
        "the compass reports its calibration again"),
    Condition.HEADING_RECKONED: Response(
        Level.DEGRADE, Kind.IGNORANCE, "the compass cannot be believed: the heading is reckoned from the wheels",
        "drives on by its wheel commands and the turn response that it has learnt",
        "the compass has been believed for 1 s"),
    Condition.MOTION_STALE: Response(
        Level.DEGRADE, Kind.IGNORANCE, "the motion sensor is silent", _BLIND_AND_SILENT, _SEES, Level.HOLD),
    Condition.MOTION_UNKNOWN: Response(
        Level.DEGRADE, Kind.IGNORANCE, "the motion sensor's picture is too poor", _BLIND, _SEES),
    Condition.MOTION_LOST: Response(
        Level.DEGRADE, Kind.IGNORANCE, "the motion sensor's picture has been too poor for seconds",
        _BLIND, _SEES, Level.HOLD),
    Condition.MOTION_GONE: Response(
        Level.DEGRADE, Kind.IGNORANCE, "the motion sensor has been silent for seconds",
        _BLIND_AND_SILENT, _SEES, Level.FAULT),
    Condition.MOTION_IMPLAUSIBLE: Response(
        Level.NOTE, Kind.IGNORANCE, "motion readings are implausible",
        "drives on, and does not use such a reading", "the next reading is plausible"),
    Condition.CONTACT_STALE: Response(
        Level.DEGRADE, Kind.IGNORANCE, "the bumper is silent",
        "drives on without it; the bumper is opened again every 2 s", "the bumper answers", Level.HOLD),
    Condition.OVERTURNED: Response(
        Level.FAULT, Kind.DANGER, "the rover lies on its side or roof", _DISARMS,
        f"it stands on its wheels and {_ARMED_AGAIN}"),
    Condition.RUNAWAY: Response(
        Level.FAULT, Kind.DANGER, "the rover moves although its wheels are commanded to stop",
        f"{_DISARMS}; it sends a stop at each tick while it moves", _ARMED_AGAIN),
    Condition.DRIVE_REVERSED: Response(
        Level.FAULT, Kind.DANGER, "the rover turns the other way than its wheels are commanded", _DISARMS, _ARMED_AGAIN,
        manual=Level.DEGRADE),
    Condition.CANNOT_TURN: Response(
        Level.NOTE, Kind.FOREST,
        "the rover does not turn on the spot at full duty: the ground or an obstacle holds it",
        "goes on with its algorithm; after twelve failed turns it tries other manoeuvres",
        "it turns on the spot"),
    Condition.ENTRAPPED: Response(
        Level.FAULT, Kind.FOREST, "the rover makes no progress any more",
        f"{_DISARMS}, because its rover file has give_up = true", _ARMED_AGAIN, manual=Level.NOTE),
    Condition.NO_PROGRESS: Response(
        Level.DEGRADE, Kind.FOREST, "the rover makes no progress: it tries other manoeuvres",
        "tries other manoeuvres, one after the other, each followed by 10 s of its algorithm",
        "it gets 0.2 m ahead without an anomaly"),
    Condition.RESTING: Response(
        Level.HOLD, Kind.FOREST,
        "the rover makes no progress: it rests, so that its motors cool, and tries again",
        "stands for 30 s; each rest without progress is twice as long as the last one, up to 10 minutes",
        "the rest is over"),
    Condition.MOTORS_FAILED: Response(
        Level.HOLD, Kind.DANGER, "the motor board did not answer, or it had a fault",
        _OPENS_BOARD, _BOARD_IS_BACK, Level.FAULT),
    Condition.BOARD_FAULT: Response(
        Level.HOLD, Kind.WEAKNESS, "the motor board reports a fault", _OPENS_BOARD, _BOARD_IS_BACK, Level.FAULT),
    Condition.BOARD_DISAGREES: Response(
        Level.FAULT, Kind.DANGER, "the motor board applies other duties than commanded",
        f"{_DISARMS}; it sends a stop at each tick while the board disagrees", _ARMED_AGAIN),
    Condition.BOARD_SILENT: Response(
        Level.DEGRADE, Kind.IGNORANCE, "the motor board does not report its status",
        "drives on, and knows neither battery nor faults", "the board reports again"),
    Condition.BATTERY_LOW: Response(
        Level.DEGRADE, Kind.WEAKNESS, "the battery is low", "drives on, and says so",
        "the battery's voltage is above the limit"),
    Condition.BATTERY_CRITICAL: Response(
        Level.FAULT, Kind.WEAKNESS, "the battery is almost empty", _DISARMS,
        f"the battery is charged or replaced and {_ARMED_AGAIN}"),
    Condition.UNDERVOLTAGE: Response(
        Level.DEGRADE, Kind.WEAKNESS, "the computer's voltage is too low: duty is limited",
        "drives on with at most 0.7 of the allowed duty", "the voltage is high enough"),
    Condition.POWER_UNSTABLE: Response(
        Level.DEGRADE, Kind.WEAKNESS, "the computer's voltage dips repeatedly",
        "drives on with at most half of the allowed duty", "there were fewer than three dips in the last minute",
        Level.HOLD),
    Condition.OPERATOR_HOLD: Response(
        Level.HOLD, Kind.OPERATOR, "an operator asked to hold", "stands", "somebody resumes it"),
    Condition.RESUME_WARNING: Response(
        Level.HOLD, Kind.DANGER, "the rover drives on in a moment: step away",
        "stands for a second more while its light blinks", "the second is over"),
    Condition.TICK_LATE: Response(
        Level.HOLD, Kind.DANGER, "the control tick came late", "stands, because an old decision must not act",
        "a tick comes in time"),
    Condition.DECISION_INVALID: Response(
        Level.FAULT, Kind.DANGER, "the algorithm gave an invalid command", _DISARMS, _ARMED_AGAIN),
}
# fmt: on

# Looked up at each tick.
LEVELS: Final[Mapping[Condition, Level]] = {condition: row.level for condition, row in RESPONSES.items()}

# While a person drives, with any rover file.
MANUAL_LEVELS: Final[Mapping[Condition, Level]] = {
    condition: row.level if row.manual is None else row.manual for condition, row in RESPONSES.items()
}

# For a rover that drives among people (``SafetySettings.on_lost_sense``): what it cannot sense stops it, and a motor
# board that failed needs a person.
HOLDING_LEVELS: Final[Mapping[Condition, Level]] = {
    condition: row.level_among_people for condition, row in RESPONSES.items()
}


def levels_for(on_lost_sense: str) -> Mapping[Condition, Level]:
    """Return the severities for ``SafetySettings.on_lost_sense``: "continue" or "hold"."""
    return HOLDING_LEVELS if on_lost_sense == "hold" else LEVELS


class Said(NamedTuple):
    """What a rover does because of a condition, and what must happen for that to end; clauses as in ``Response``."""

    does: str
    ends_when: str


def said_of(condition: Condition, level: Level, *, by_hand: bool = False) -> Said:
    """Return the words for a condition of a rover for which it has this level; ``by_hand``: a person drives it."""
    row = RESPONSES[condition]
    obeys = by_hand and level < Level.HOLD and row.kind in {Kind.IGNORANCE, Kind.FOREST}  # no manoeuvre is begun
    if obeys or (level is row.manual and level is not row.level):
        return Said("drives as the person wants", row.ends_when)
    if level is row.level:
        return Said(row.does, row.ends_when)
    return Said(_DISARMS, _ARMED_AGAIN) if level is Level.FAULT else Said("stands", row.ends_when)


def worst(conditions: Iterable[Condition], levels: Mapping[Condition, Level] = LEVELS) -> Condition | None:
    """Return the most severe condition, the first of equals, or None."""
    return max(conditions, key=levels.__getitem__, default=None)
