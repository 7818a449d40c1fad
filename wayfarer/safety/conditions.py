"""Conditions of the rover's health: one table of how severe each is, of what kind, and what else it means.

These are not anomalies. An anomaly (``escape.api.Anomaly``) says that the forest is in the way, and the escape handler
responds with a manoeuvre. A condition says that the rover itself is not well, and the safety gate responds.

What is dangerous stops the wheels: wheels that turn unasked, that cannot be stopped, that nobody expects to turn.
A missing reading does not stop the wheels: a rover that stops in a wood for lack of a sensor is lost. So it goes on
with limits.

``wayfarer.vocabulary`` has the words for each condition.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum, Flag, IntEnum
from typing import Final, NamedTuple


class Level(IntEnum):
    """Severity of a condition. The motor board's own deadman (S4) acts without wayfarer and is not listed."""

    WELL = -1  # nothing is wrong; logs record the names in lower case, so they stay
    NOTE = 0  # S0: written to the log
    DEGRADE = 1  # S1: continue, with less duty if the row says so
    HOLD = 2  # S2: wheels zero, resumes when the condition clears
    FAULT = 3  # S3: wheels zero, latched until re-armed


class Kind(Enum):
    """Why a condition is one; ``vocabulary.KIND_TEXTS`` says it in words."""

    DANGER = "danger"
    IGNORANCE = "ignorance"
    WEAKNESS = "weakness"
    FOREST = "forest"
    OPERATOR = "operator"


class Means(Flag):
    """What a condition means beside its level."""

    NOTHING_ELSE = 0
    BLIND = 1  # the motion sensor sees nothing: a stride without sight is bounded
    HEADING_DOUBTED = 2  # the compass cannot be believed: on a mission the heading is reckoned in its place
    SILENCE = 4  # a sensor that the run needs does not answer: systemd may start the daemon again
    UNCOMMANDED = 8  # the wheels do what nobody has commanded: a stop is sent at each tick
    NOT_ARMED = 16  # arming again does not clear it, so that ``arm`` refuses
    STRICTER_AMONG_PEOPLE = 32  # one level more severe for a rover with ``on_lost_sense = "hold"``


class Condition(Enum):
    """What can be wrong with the rover itself."""

    COMPASS_STALE = "compass_stale"
    COMPASS_LOST = "compass_lost"
    COMPASS_IMPLAUSIBLE = "compass_implausible"
    COMPASS_FROZEN = "compass_frozen"
    COMPASS_UNCALIBRATED = "compass_uncalibrated"
    HEADING_RECKONED = "heading_reckoned"
    MOTION_UNKNOWN = "motion_unknown"
    MOTION_STALE = "motion_stale"
    MOTION_IMPLAUSIBLE = "motion_implausible"
    CONTACT_STALE = "contact_stale"
    WHEELS_STALE = "wheels_stale"
    SLIP_UNSEEN = "slip_unseen"
    OVERTURNED = "overturned"
    RUNAWAY = "runaway"
    DRIVE_REVERSED = "drive_reversed"
    CANNOT_TURN = "cannot_turn"
    ENTRAPPED = "entrapped"
    NO_PROGRESS = "no_progress"
    RESTING = "resting"
    MOTORS_FAILED = "motors_failed"
    BOARD_DISAGREES = "board_disagrees"
    BOARD_SILENT = "board_silent"
    BATTERY_LOW = "battery_low"
    BATTERY_CRITICAL = "battery_critical"
    UNDERVOLTAGE = "undervoltage"
    POWER_UNSTABLE = "power_unstable"
    OPERATOR_HOLD = "operator_hold"
    RESUME_WARNING = "resume_warning"
    TICK_LATE = "tick_late"
    DECISION_INVALID = "decision_invalid"


class Row(NamedTuple):
    """A row of the table; ``duty_share`` is the share of the highest duty that is left to the wheels."""

    level: Level
    kind: Kind
    means: Means = Means.NOTHING_ELSE
    duty_share: float = 1.0


# fmt: off
TABLE: Final[Mapping[Condition, Row]] = {
    Condition.COMPASS_STALE: Row(Level.HOLD, Kind.IGNORANCE, Means.HEADING_DOUBTED | Means.SILENCE),
    Condition.COMPASS_LOST: Row(
        Level.FAULT, Kind.IGNORANCE, Means.HEADING_DOUBTED | Means.SILENCE | Means.NOT_ARMED),
    Condition.COMPASS_IMPLAUSIBLE: Row(Level.HOLD, Kind.IGNORANCE, Means.HEADING_DOUBTED),
    Condition.COMPASS_FROZEN: Row(Level.HOLD, Kind.IGNORANCE, Means.HEADING_DOUBTED),
    Condition.COMPASS_UNCALIBRATED: Row(Level.DEGRADE, Kind.IGNORANCE),
    Condition.HEADING_RECKONED: Row(Level.DEGRADE, Kind.IGNORANCE),
    Condition.MOTION_UNKNOWN: Row(Level.DEGRADE, Kind.IGNORANCE, Means.BLIND | Means.STRICTER_AMONG_PEOPLE),
    Condition.MOTION_STALE: Row(
        Level.DEGRADE, Kind.IGNORANCE, Means.BLIND | Means.SILENCE | Means.NOT_ARMED | Means.STRICTER_AMONG_PEOPLE),
    Condition.MOTION_IMPLAUSIBLE: Row(Level.NOTE, Kind.IGNORANCE),
    Condition.CONTACT_STALE: Row(Level.DEGRADE, Kind.IGNORANCE, Means.SILENCE | Means.STRICTER_AMONG_PEOPLE),
    Condition.WHEELS_STALE: Row(Level.DEGRADE, Kind.IGNORANCE, Means.SILENCE | Means.STRICTER_AMONG_PEOPLE),
    # It has no sensor that could: no sense was lost, so that it drives among people as well.
    Condition.SLIP_UNSEEN: Row(Level.NOTE, Kind.IGNORANCE, Means.BLIND),
    Condition.OVERTURNED: Row(Level.FAULT, Kind.DANGER, Means.NOT_ARMED),
    Condition.RUNAWAY: Row(Level.FAULT, Kind.DANGER, Means.UNCOMMANDED),
    # Its wheels or its compass are the wrong way round, and it does not know which; who drives it by hand sees it.
    Condition.DRIVE_REVERSED: Row(Level.FAULT, Kind.IGNORANCE),
    Condition.CANNOT_TURN: Row(Level.NOTE, Kind.FOREST),
    Condition.ENTRAPPED: Row(Level.FAULT, Kind.FOREST),
    Condition.NO_PROGRESS: Row(Level.DEGRADE, Kind.FOREST),
    Condition.RESTING: Row(Level.HOLD, Kind.FOREST),
    Condition.MOTORS_FAILED: Row(Level.HOLD, Kind.DANGER, Means.STRICTER_AMONG_PEOPLE),
    Condition.BOARD_DISAGREES: Row(Level.FAULT, Kind.DANGER, Means.UNCOMMANDED | Means.NOT_ARMED),
    Condition.BOARD_SILENT: Row(Level.DEGRADE, Kind.IGNORANCE),
    Condition.BATTERY_LOW: Row(Level.DEGRADE, Kind.WEAKNESS),
    Condition.BATTERY_CRITICAL: Row(Level.FAULT, Kind.WEAKNESS, Means.NOT_ARMED),
    # Fault catalogue, fault 32: less duty while the computer's supply sags.
    Condition.UNDERVOLTAGE: Row(Level.DEGRADE, Kind.WEAKNESS, duty_share=0.7),
    # While it sags again and again: about 0.7 of what already was too much; chosen by us.
    Condition.POWER_UNSTABLE: Row(
        Level.DEGRADE, Kind.WEAKNESS, Means.NOT_ARMED | Means.STRICTER_AMONG_PEOPLE, duty_share=0.5),
    Condition.OPERATOR_HOLD: Row(Level.HOLD, Kind.OPERATOR),
    Condition.RESUME_WARNING: Row(Level.HOLD, Kind.DANGER),
    Condition.TICK_LATE: Row(Level.HOLD, Kind.DANGER),
    Condition.DECISION_INVALID: Row(Level.FAULT, Kind.DANGER),
}
# fmt: on

# -- what follows from the table; looked up at each tick -----------------------------------------------------------

LEVELS: Final[Mapping[Condition, Level]] = {condition: row.level for condition, row in TABLE.items()}

# While a person drives, with any rover file: they see what the rover does not, and what holds it.
_MOST_BY_HAND: Final[Mapping[Kind, Level]] = {Kind.IGNORANCE: Level.DEGRADE, Kind.FOREST: Level.NOTE}
MANUAL_LEVELS: Final[Mapping[Condition, Level]] = {
    condition: min(row.level, _MOST_BY_HAND.get(row.kind, Level.FAULT)) for condition, row in TABLE.items()
}

# For a rover that drives among people (``SafetySettings.on_lost_sense``): what blinds it holds it, and a motor board
# that failed needs a person.
HOLDING_LEVELS: Final[Mapping[Condition, Level]] = {
    condition: Level(row.level + 1) if Means.STRICTER_AMONG_PEOPLE in row.means else row.level
    for condition, row in TABLE.items()
}

DUTY_SHARES: Final[Mapping[Condition, float]] = {condition: row.duty_share for condition, row in TABLE.items()}


def _that(means: Means) -> frozenset[Condition]:
    """Return the conditions that mean all of this."""
    return frozenset(condition for condition, row in TABLE.items() if means in row.means)


BLIND: Final = _that(Means.BLIND)
HEADING_DOUBTED: Final = _that(Means.HEADING_DOUBTED)
SILENCE: Final = _that(Means.SILENCE)
SILENT_COMPASS: Final = HEADING_DOUBTED & SILENCE
UNCOMMANDED: Final = _that(Means.UNCOMMANDED)
NOT_ARMED: Final = _that(Means.NOT_ARMED)
NOT_DRIVEN: Final = frozenset(each for each in NOT_ARMED if MANUAL_LEVELS[each] >= Level.HOLD)  # not even by hand


def levels_for(on_lost_sense: str) -> Mapping[Condition, Level]:
    """Return the severities for ``SafetySettings.on_lost_sense``: "continue" or "hold"."""
    return HOLDING_LEVELS if on_lost_sense == "hold" else LEVELS


def worst(conditions: Iterable[Condition], levels: Mapping[Condition, Level] = LEVELS) -> Condition | None:
    """Return the most severe condition, the first of equals, or None."""
    return max(conditions, key=levels.__getitem__, default=None)
