"""Colour and rhythm of the status light for each state of the rover, readable at ten metres. Pure.

=========  =======  ========================================
colour     rhythm   meaning
=========  =======  ========================================
blue       steady   disarmed
yellow     fast     arming, or a long hold has ended: step away, it drives off soon
green      steady   driving
white      slow     escaping: feeling its way around something
yellow     steady   held, goes on by itself or by ``wayfarer resume``
magenta    slow     battery low
red        fast     fault: only a person can re-arm it
=========  =======  ========================================
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wayfarer.escape.api import Phase
from wayfarer.hal import Colour
from wayfarer.safety.conditions import Condition, Level

if TYPE_CHECKING:
    from wayfarer.control.controller import Controller

LIGHT_HZ = 8.0
STEADY, SLOW_HZ, FAST_HZ = 0.0, 1.0, 4.0

OFF = Colour(0.0, 0.0, 0.0)
BLUE, GREEN, RED = Colour(0.0, 0.0, 1.0), Colour(0.0, 1.0, 0.0), Colour(1.0, 0.0, 0.0)
YELLOW, MAGENTA, WHITE = Colour(1.0, 0.6, 0.0), Colour(1.0, 0.0, 1.0), Colour(1.0, 1.0, 1.0)


def colour(controller: Controller, t_s: float) -> Colour:
    """Return what the light shows now."""
    shown, blink_hz = _signal(controller)
    return shown if blink_hz == STEADY or (t_s * blink_hz) % 1.0 < 0.5 else OFF


def _signal(controller: Controller) -> tuple[Colour, float]:
    last = controller.last
    level = Level.WELL if last is None else last.level
    if level is Level.FAULT:
        return RED, FAST_HZ
    if controller.mode.value == "arming" or Condition.RESUME_WARNING in controller.conditions:
        return YELLOW, FAST_HZ
    if Condition.BATTERY_LOW in controller.conditions:
        return MAGENTA, SLOW_HZ
    if controller.mode.value == "disarmed" or last is None:
        return BLUE, STEADY
    if level is Level.HOLD:
        return YELLOW, STEADY
    return (GREEN, STEADY) if last.decision.phase is Phase.FOLLOW else (WHITE, SLOW_HZ)
