"""One control tick: its inputs, and its record. ``Controller.step`` makes the record from the inputs.

The tasks of the parts write at their own rates, and the tick takes all at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Final, NamedTuple

from wayfarer.control.modes import Mode
from wayfarer.detector.detector import DetectorTick
from wayfarer.escape.api import Decision, Observation, Phase
from wayfarer.hal import (
    STOP,
    CompassReading,
    ContactReading,
    MotionReading,
    MotorHealth,
    PositionFix,
    WheelCommand,
    WheelReading,
)
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.manual import ManualSample


class BoardReport(NamedTuple):
    """What the motor board said at ``t_s``.

    ``health`` is None if it did not answer, and ``error`` says why. ``duties`` are those that it reports as applied,
    None if it cannot.
    """

    t_s: float
    health: MotorHealth | None
    duties: WheelCommand | None = None
    error: str = ""


class PowerFlags(NamedTuple):
    """The power flags of the computer's firmware at ``t_s``, None if there are none; see ``power.SupplyMonitor``."""

    t_s: float
    flags: int | None


class Inputs:
    """All that came from outside until the tick at ``t_s``.

    ``compass`` and ``contact`` are the newest readings, None before the first. ``motion`` and ``wheels`` are what was
    moved since the tick before, None if nothing was read since. ``applied`` is what the motors applied at the tick
    before. ``fixes``, ``board`` and ``power`` came since then, oldest first; a fix is None if the receiver has none.
    """

    # No dataclass: the compiled core would run its ``__init__`` in the interpreter.
    def __init__(self, compass: CompassReading | None, contact: ContactReading | None, applied: WheelCommand) -> None:
        self.t_s = 0.0
        self.compass = compass
        self.motion: MotionReading | None = None
        self.contact = contact
        self.wheels: WheelReading | None = None
        self.applied = applied
        self.fixes: tuple[PositionFix | None, ...] = ()
        self.board: tuple[BoardReport, ...] = ()
        self.power: tuple[PowerFlags, ...] = ()


class Inbox:
    """Where the tasks of the parts put what they read; ``next`` is what the next tick gets.

    ``motion`` and ``wheels`` are the newest readings of these sensors, None before the first.
    """

    def __init__(self) -> None:
        self.motion: MotionReading | None = None
        self.wheels: WheelReading | None = None
        self.next = Inputs(None, None, STOP)

    def put_compass(self, reading: CompassReading) -> None:
        """Take a heading; an older one that no tick has seen is forgotten."""
        self.next.compass = reading

    def put_contact(self, reading: ContactReading) -> None:
        """Take what the bumper feels; an older reading that no tick has seen is forgotten."""
        self.next.contact = reading

    def put_motion(self, reading: MotionReading) -> None:
        """Add up displacements until a tick takes them, so that none is lost at any sensor rate.

        The quality of the sum is that of its worst part, because the sum of only some displacements is wrong. If time
        or quality of a part is NaN or infinite, the quality of the sum is 0 (fault catalogue, fault 8).
        """
        self.motion = reading
        moved = self.next.motion
        if moved is not None:
            known = isfinite(moved.t_s + moved.quality + reading.t_s + reading.quality)
            reading = MotionReading(
                reading.t_s,
                moved.forward_m + reading.forward_m,
                moved.right_m + reading.right_m,
                min(moved.quality, reading.quality) if known else 0.0,
                reading.signed,
            )
        self.next.motion = reading

    def put_wheels(self, reading: WheelReading) -> None:
        """Add up the ways of the rims until a tick takes them; a sum of which a part is not known is not known.

        The current is the newest.
        """
        self.wheels = reading
        before = self.next.wheels
        if before is not None:
            left_m, right_m = _sum(before.left_m, reading.left_m), _sum(before.right_m, reading.right_m)
            reading = WheelReading(reading.t_s, left_m, right_m, reading.left_a, reading.right_a)
        self.next.wheels = reading

    def put_fix(self, fix: PositionFix | None) -> None:
        """Take a position; no decision sees it, only the log and the mission's radius."""
        self.next.fixes += (fix,)

    def put_board(self, report: BoardReport) -> None:
        """Take what the motor board said, or that it did not answer."""
        self.next.board += (report,)

    def put_power(self, t_s: float, flags: int | None) -> None:
        """Take the power flags of the computer's firmware."""
        self.next.power += (PowerFlags(t_s, flags),)

    def take(self, t_s: float) -> Inputs:
        """Return what the tick at ``t_s`` gets."""
        inputs = self.next
        inputs.t_s = t_s
        self.next = Inputs(inputs.compass, inputs.contact, inputs.applied)
        return inputs


def _sum(one_m: float | None, other_m: float | None) -> float | None:
    return None if one_m is None or other_m is None else one_m + other_m


STAND: Final = Decision(STOP, Phase.HALT, Phase.HALT.value)


class TickRecord(DetectorTick):
    """One control tick, filled in stage by stage: what was seen, decided and applied, and the gate's level and cause.

    ``observation`` is what the handler saw of the readings (None before the first plausible heading). ``manual`` is the
    newest sample of a person who drives, None if nobody does, or has asked for anything yet. ``memory`` gives
    the handler's inner state and is valid only until the next tick, so a log that keeps it calls it at once.
    ``mode`` and ``held`` are those in which it was decided. ``north_m``, ``east_m`` and ``path_m`` are dead reckoning
    since the run began, None before the first heading; ``mission_s``, ``mission_m`` and ``goal_heading_deg`` are those
    of a mission, None without one.
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
    mode: Mode = Mode.DISARMED
    held: bool = False
    north_m: float | None = None
    east_m: float | None = None
    path_m: float = 0.0
    mission_s: float | None = None
    mission_m: float | None = None
    goal_heading_deg: float | None = None
    wheels: WheelCommand = STOP
    halts: bool = False
    concluded: tuple[tuple[str, str, Mapping[str, object]], ...] = ()

    def conclude(self, severity: str, name: str, **details: object) -> None:
        """Add an event that follows from the tick; the log has it after the tick's record."""
        self.concluded += ((severity, name, details),)
