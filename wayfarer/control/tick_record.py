"""The record of one control tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from wayfarer.detector.detector import DetectorTick
from wayfarer.escape.api import Decision, Observation, Phase
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.manual import ManualSample

STAND: Final = Decision(STOP, Phase.HALT, Phase.HALT.value)


class TickRecord(DetectorTick):
    """One control tick, filled in stage by stage: what was seen, decided and applied, and the gate's level and cause.

    ``observation`` is what the handler saw of the readings (None before the first plausible heading). ``manual`` is the
    newest sample of a person who drives, None if nobody does, or has asked for anything yet. ``memory`` gives
    the handler's inner state and is valid only until the next tick, so a log that keeps it calls it at once.
    ``wheels`` are the duties that the motors are to get. ``halts`` asks for a stop beside them, at each tick: a board
    that does not obey may obey one of many stops. ``concluded`` are the events that follow from the tick.
    """

    observation: Observation | None = None
    decision: Decision = STAND
    applied: WheelCommand = STOP
    level: Level = Level.WELL
    cause: Condition | None = None
    manual: ManualSample | None = None
    memory: Callable[[], Mapping[str, float | str]] = dict
    wheels: WheelCommand = STOP
    halts: bool = False
    concluded: tuple[tuple[str, Mapping[str, object]], ...] = ()

    def conclude(self, name: str, **details: object) -> None:
        """Add an event that follows from the tick; the log has it after the tick's record."""
        self.concluded += ((name, details),)
