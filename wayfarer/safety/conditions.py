"""Conditions of the rover's health and the response to each: one table, the most severe wins.

These are not anomalies. An anomaly (``escape.api.Anomaly``) says that the forest is in the way, and the escape handler
responds with a manoeuvre. A condition says that the rover itself is not well, and the safety gate responds.

What is dangerous stops the wheels: wheels that turn unasked, that cannot be stopped, that nobody expects to turn.
Ignorance is no danger. A rover that has lost a sense in a wood is lost if it stands, so it goes on with limits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import Enum, IntEnum
from typing import Final


class Level(IntEnum):
    """Severity of a condition. The motor board's own deadman (S4) acts without wayfarer and is not listed."""

    WELL = -1
    NOTE = 0  # S0: written to the log
    DEGRADE = 1  # S1: continue with limits
    HOLD = 2  # S2: wheels zero, resumes when the condition clears
    FAULT = 3  # S3: wheels zero, latched until re-armed


class Condition(Enum):
    """What can be wrong with the rover itself."""

    COMPASS_STALE = "compass_stale"
    COMPASS_LOST = "compass_lost"
    COMPASS_IMPLAUSIBLE = "compass_implausible"
    COMPASS_FROZEN = "compass_frozen"
    COMPASS_UNCALIBRATED = "compass_uncalibrated"
    HEADING_RECKONED = "heading_reckoned"
    MOTION_STALE = "motion_stale"
    MOTION_UNKNOWN = "motion_unknown"
    MOTION_LOST = "motion_lost"
    MOTION_GONE = "motion_gone"
    MOTION_IMPLAUSIBLE = "motion_implausible"
    CONTACT_STALE = "contact_stale"
    OVERTURNED = "overturned"
    RUNAWAY = "runaway"
    DRIVE_SUSPECTED = "drive_suspected"
    DRIVE_WEAK = "drive_weak"
    DRIVE_REVERSED = "drive_reversed"
    CANNOT_TURN = "cannot_turn"
    ENTRAPPED = "entrapped"
    NO_PROGRESS = "no_progress"
    RESTING = "resting"
    MOTORS_FAILED = "motors_failed"
    BOARD_FAULT = "board_fault"
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


LEVELS: Final[Mapping[Condition, Level]] = {
    Condition.COMPASS_STALE: Level.HOLD,
    Condition.COMPASS_LOST: Level.FAULT,
    Condition.COMPASS_IMPLAUSIBLE: Level.HOLD,
    Condition.COMPASS_FROZEN: Level.HOLD,
    Condition.COMPASS_UNCALIBRATED: Level.DEGRADE,
    Condition.HEADING_RECKONED: Level.DEGRADE,
    Condition.MOTION_STALE: Level.DEGRADE,
    Condition.MOTION_UNKNOWN: Level.DEGRADE,
    Condition.MOTION_LOST: Level.DEGRADE,
    Condition.MOTION_GONE: Level.DEGRADE,
    Condition.MOTION_IMPLAUSIBLE: Level.NOTE,
    Condition.CONTACT_STALE: Level.DEGRADE,
    Condition.OVERTURNED: Level.FAULT,
    Condition.RUNAWAY: Level.FAULT,
    Condition.DRIVE_SUSPECTED: Level.DEGRADE,
    Condition.DRIVE_WEAK: Level.DEGRADE,
    Condition.DRIVE_REVERSED: Level.FAULT,
    Condition.CANNOT_TURN: Level.NOTE,
    Condition.ENTRAPPED: Level.FAULT,
    Condition.NO_PROGRESS: Level.DEGRADE,
    Condition.RESTING: Level.HOLD,
    Condition.MOTORS_FAILED: Level.FAULT,
    Condition.BOARD_FAULT: Level.FAULT,
    Condition.BOARD_DISAGREES: Level.FAULT,
    Condition.BOARD_SILENT: Level.DEGRADE,
    Condition.BATTERY_LOW: Level.DEGRADE,
    Condition.BATTERY_CRITICAL: Level.FAULT,
    Condition.UNDERVOLTAGE: Level.DEGRADE,
    Condition.POWER_UNSTABLE: Level.DEGRADE,
    Condition.OPERATOR_HOLD: Level.HOLD,
    Condition.RESUME_WARNING: Level.HOLD,
    Condition.TICK_LATE: Level.HOLD,
    Condition.DECISION_INVALID: Level.FAULT,
}


# For a rover that drives among people (``SafetySettings.on_lost_sense``): what it cannot sense stops it.
HOLDING_LEVELS: Final[Mapping[Condition, Level]] = {
    **LEVELS,
    Condition.MOTION_STALE: Level.HOLD,
    Condition.MOTION_LOST: Level.HOLD,
    Condition.MOTION_GONE: Level.FAULT,
    Condition.CONTACT_STALE: Level.HOLD,
    Condition.DRIVE_WEAK: Level.FAULT,
    Condition.POWER_UNSTABLE: Level.HOLD,
}


def levels_for(on_lost_sense: str) -> Mapping[Condition, Level]:
    """Return the severities for ``SafetySettings.on_lost_sense``: "continue" or "hold"."""
    return HOLDING_LEVELS if on_lost_sense == "hold" else LEVELS


def worst(conditions: Iterable[Condition], levels: Mapping[Condition, Level] = LEVELS) -> Condition | None:
    """Return the most severe condition, the first of equals, or None."""
    return max(conditions, key=levels.__getitem__, default=None)
