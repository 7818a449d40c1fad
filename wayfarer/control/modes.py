"""The mode of the rover, and the one table of what changes it. Pure.

The wheels may turn only in the modes ``ARMED`` and ``MANUAL``. What is not in the table is refused, with a reason that
the caller must handle; a refusal changes nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final, NamedTuple


class Mode(Enum):
    """Arming state of the rover; the wheels may turn only while it is ``ARMED``, or while a person drives."""

    DISARMED = "disarmed"
    ARMING = "arming"
    ARMED = "armed"
    MANUAL = "manual"


class Event(Enum):
    """What may change the mode, or what the rover does in it."""

    ARM = "arm"
    SETTLED = "the start delay is over and the heading is known"
    DISARM = "disarm, fault or mission limit"
    MANUAL = "a person drives"
    END_MANUAL = "the person ends, or is silent"
    HOLD = "hold"
    RESUME = "resume"
    GOAL = "goal"
    BOARD_OPENED = "the motor board was opened again"


class Entered(NamedTuple):
    """The event took place; ``mode`` is the mode now."""

    mode: Mode


class Refused(NamedTuple):
    """The event did not take place, and nothing has changed; ``why`` says so to a person."""

    why: str


Outcome = Entered | Refused


class Row(NamedTuple):
    """A row of the table: the next mode, None for the one before a person drove, and what is done."""

    to: Mode | None
    does: str


_STAYS: Final = "nothing: the rover is disarmed already"
_HELD: Final = "the wheels stop until somebody resumes; the mission waits"
MODES: Final[Mapping[tuple[Mode, Event], Row]] = {
    (Mode.DISARMED, Event.ARM): Row(Mode.ARMING, "the start delay begins"),
    (Mode.DISARMED, Event.MANUAL): Row(Mode.MANUAL, "the wheels follow the person"),
    (Mode.DISARMED, Event.DISARM): Row(Mode.DISARMED, _STAYS),
    (Mode.ARMING, Event.SETTLED): Row(Mode.ARMED, "the mission begins"),
    (Mode.ARMING, Event.DISARM): Row(Mode.DISARMED, "arming is over"),
    (Mode.ARMING, Event.HOLD): Row(Mode.ARMING, "arming waits, and is given up if that lasts"),
    (Mode.ARMING, Event.RESUME): Row(Mode.ARMING, "arming goes on"),
    (Mode.ARMED, Event.DISARM): Row(Mode.DISARMED, "the mission is over"),
    (Mode.ARMED, Event.HOLD): Row(Mode.ARMED, _HELD),
    (Mode.ARMED, Event.RESUME): Row(Mode.ARMED, "the mission goes on"),
    (Mode.ARMED, Event.GOAL): Row(Mode.ARMED, "the mission has another goal heading"),
    (Mode.ARMED, Event.MANUAL): Row(Mode.MANUAL, "the mission waits; the wheels follow the person"),
    (Mode.ARMED, Event.BOARD_OPENED): Row(Mode.ARMED, "the mission goes on after the warning"),
    (Mode.MANUAL, Event.DISARM): Row(Mode.DISARMED, "driving by hand is over, and so is a mission that waits"),
    (Mode.MANUAL, Event.END_MANUAL): Row(None, "disarmed, or the mission that waited is held"),
    (Mode.MANUAL, Event.HOLD): Row(None, "disarmed, or the mission that waited is held"),
    (Mode.MANUAL, Event.BOARD_OPENED): Row(Mode.MANUAL, "the person may drive on, after letting go"),
}
MAY_TURN: Final = frozenset({Mode.ARMED, Mode.MANUAL})


_WHY_NOT: Final[Mapping[Event, str]] = {
    Event.GOAL: "the rover is {mode}: give the heading when arming (wayfarer arm DEG)",
    Event.HOLD: "the rover is disarmed: its wheels do not turn",
    Event.RESUME: "the rover is not held: there is nothing to resume",
    Event.END_MANUAL: "nobody drives the rover by hand",
    Event.BOARD_OPENED: "the rover is {mode}: nothing waits for the motor board",
}


def refusal(mode: Mode, event: Event) -> str:
    """Return why an event is refused in this mode, or an empty text."""
    if (mode, event) in MODES:
        return ""
    doing = "driven by a person" if mode is Mode.MANUAL else mode.value
    why = _WHY_NOT.get(event, "the rover is {mode} already: disarm it first (wayfarer disarm)")
    return why.format(mode=doing)
