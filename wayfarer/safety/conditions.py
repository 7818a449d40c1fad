"""Conditions of the rover's health, and how severe they can be. ``responses`` has what the rover does about each.

These are not anomalies. An anomaly (``escape.api.Anomaly``) says that the forest is in the way, and the escape handler
responds with a manoeuvre. A condition says that the rover itself is not well, and the safety gate responds.

What is dangerous stops the wheels: wheels that turn unasked, that cannot be stopped, that nobody expects to turn.
Ignorance is no danger. A rover that has lost a sense in a wood is lost if it stands, so it goes on with limits.
"""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Final


class Level(IntEnum):
    """Severity of a condition. The motor board's own deadman (S4) acts without wayfarer and is not listed."""

    WELL = -1  # nothing is wrong; logs record the names in lower case, so they stay
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


BLIND: Final = frozenset(
    {Condition.MOTION_STALE, Condition.MOTION_UNKNOWN, Condition.MOTION_LOST, Condition.MOTION_GONE}
)
"""What says that the motion sensor sees nothing."""
