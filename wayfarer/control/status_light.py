"""Colour and rhythm of the status light for each state of the rover, readable at ten metres. Pure.

=========  =======  ========================================
colour     rhythm   meaning
=========  =======  ========================================
blue       steady   disarmed
yellow     fast     arming, or a long hold has ended: step away, it drives off soon
green      steady   driving
white      slow     escaping: feeling its way around something
cyan       twice    driving with limits: a sensor is lost, a side is weak, there is no progress
green      slow     driven by a person
yellow     steady   held, goes on by itself or by ``wayfarer resume``
magenta    slow     battery low
red        fast     fault, or a motor board that failed while disarmed: only a person can arm it
=========  =======  ========================================

For ten seconds after its start, a rover that stands disarmed shows how the last mission before that ended:

=========  =======  ========================================
colour     rhythm   meaning
=========  =======  ========================================
green      twice    out: it has left the wood
yellow     twice    stopped: by a person, or by its limit of time or distance
red        thrice   failed: by a fault of the rover or of its program
magenta    thrice   unfinished: its power went, or its process was killed
=========  =======  ========================================

*Slow* is on and off for half a second each, *fast* for an eighth. *Twice* is two short flashes every two seconds,
*thrice* three, so that a light of one colour can be read as well.
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, NamedTuple

from wayfarer.escape.api import Phase
from wayfarer.hal import Colour
from wayfarer.safety.conditions import Condition, Level

if TYPE_CHECKING:
    from wayfarer.control.controller import Controller

LIGHT_HZ = 8.0
LAST_END_S = 10.0  # five times two or three flashes: long enough to look up from the switch


class Rhythm(NamedTuple):
    """So many flashes of ``flash_s``, as far apart, every ``period_s``; a steady light has one for the whole period."""

    period_s: float
    flashes: int
    flash_s: float

    def lit(self, t_s: float) -> bool:
        """Return whether the light is on."""
        flash, into_s = divmod(t_s % self.period_s, 2.0 * self.flash_s)
        return flash < self.flashes and into_s < self.flash_s


STEADY, SLOW, FAST, TWICE = Rhythm(1.0, 1, 1.0), Rhythm(1.0, 1, 0.5), Rhythm(0.25, 1, 0.125), Rhythm(2.0, 2, 0.25)
THRICE = Rhythm(2.0, 3, 0.25)

OFF = Colour(0.0, 0.0, 0.0)
BLUE, GREEN, RED = Colour(0.0, 0.0, 1.0), Colour(0.0, 1.0, 0.0), Colour(1.0, 0.0, 0.0)
YELLOW, MAGENTA, WHITE = Colour(1.0, 0.6, 0.0), Colour(1.0, 0.0, 1.0), Colour(1.0, 1.0, 1.0)
CYAN = Colour(0.0, 1.0, 1.0)


class LastEnd(Enum):
    """How the last mission of the run before ended, each with its colour and rhythm."""

    OUT = (GREEN, TWICE)
    STOPPED = (YELLOW, TWICE)
    FAILED = (RED, THRICE)
    UNFINISHED = (MAGENTA, THRICE)


def colour(controller: Controller, t_s: float, last_end: LastEnd | None = None) -> Colour:
    """Return what the light shows now; ``last_end`` in place of disarmed."""
    shown, rhythm = _signal(controller, (BLUE, STEADY) if last_end is None else last_end.value)
    return shown if rhythm.lit(t_s) else OFF


def _signal(controller: Controller, disarmed: tuple[Colour, Rhythm]) -> tuple[Colour, Rhythm]:
    last, mode = controller.last, controller.mode.value
    level = Level.WELL if last is None else last.level
    if level is Level.FAULT or (mode == "disarmed" and Condition.MOTORS_FAILED in controller.conditions):
        return RED, FAST
    if mode == "arming" or Condition.RESUME_WARNING in controller.conditions:
        return YELLOW, FAST
    if Condition.BATTERY_LOW in controller.conditions:
        return MAGENTA, SLOW
    if mode == "disarmed" or last is None:
        return disarmed
    if level is Level.HOLD:
        return YELLOW, STEADY
    return _driving(level, last.decision.phase)


def _driving(level: Level, phase: Phase) -> tuple[Colour, Rhythm]:
    if phase is Phase.MANUAL:
        return GREEN, SLOW
    if level is Level.DEGRADE:
        return CYAN, TWICE
    return (GREEN, STEADY) if phase is Phase.FOLLOW else (WHITE, SLOW)
