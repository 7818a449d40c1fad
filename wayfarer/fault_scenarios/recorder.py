"""Records everything that the field code read, concluded and did in a scenario, tick by tick."""

from __future__ import annotations

import asyncio
from math import inf
from typing import Any, NamedTuple

from wayfarer.control.controller import Mode
from wayfarer.control.records import TickRecord
from wayfarer.hal import MotorHealth, PositionFix, Snapshot, WheelCommand
from wayfarer.safety.conditions import Condition, Level
from wayfarer.simhal.faults.kinds import Fault


class RecordedTick(NamedTuple):
    """One control tick."""

    t_s: float
    mode: Mode
    snapshot: Snapshot
    level: Level
    cause: Condition | None
    conditions: tuple[Condition, ...]
    why: str
    applied: WheelCommand
    commanded: tuple[float, float]


class RecordedEvent(NamedTuple):
    """One event of the log."""

    t_s: float
    name: str
    details: dict[str, Any]


class RunRecorder:
    """Implements ``records.RunLog``. ``follow`` tells it whose run it is."""

    def __init__(self) -> None:
        self.moments: list[RecordedTick] = []
        self.recorded_events: list[RecordedEvent] = []
        self.boards: list[tuple[float, tuple[MotorHealth, WheelCommand | None]]] = []
        self.fixes: list[PositionFix | None] = []
        self.faults: list[tuple[float, Fault, bool]] = []
        self.stood_still_s: list[tuple[float, bool]] = []
        self.ended: str | None = None
        self.ended_s = inf
        self._setup: Any = None

    def follow(self, setup: Any) -> None:
        """Watch a stage: its world and its controller."""
        self._setup = setup
        watch, world = setup.world.after_step, setup.world

        def look(moved: Any) -> None:
            if self.ended is None:  # wheels that stand after the end of a run say nothing of the fault
                self.stood_still_s.append((world.t_s, world.commanded == (0.0, 0.0)))
            watch(moved)

        world.after_step = look

    def tick(self, record: TickRecord) -> None:
        """Take a control tick."""
        controller, world = self._setup.supervisor.controller, self._setup.world
        self.moments.append(
            RecordedTick(
                record.t_s,
                controller.mode,
                record.snapshot,
                record.level,
                record.cause,
                controller.conditions,
                record.decision.why,
                record.applied,
                world.commanded,
            )
        )

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take an event; the stop at the end of a run is looked at as well."""
        self.recorded_events.append(RecordedEvent(t_s, name, details))
        if name == "wheels_stopped":
            self.stood_still_s.append((_now_s(), self._setup.world.commanded == (0.0, 0.0)))

    def position(self, fix: PositionFix | None) -> None:
        """Take a fix."""
        self.fixes.append(fix)

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Take what the board said."""
        self.boards.append((t_s, (health, duties)))

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002 - the interface's
        """Take why the run ended."""
        self.ended, self.ended_s = reason, _now_s()

    def note(self, t_s: float, fault: Fault, *, begins: bool) -> None:
        """Take the beginning of a fault, or its end."""
        self.faults.append((t_s, fault, begins))


def _now_s() -> float:
    return asyncio.get_running_loop().time()
