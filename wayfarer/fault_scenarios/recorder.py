"""Records everything that the field code read, concluded and did in a scenario, tick by tick."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf
from typing import NamedTuple

from wayfarer.control.tick_record import TickRecord
from wayfarer.experiments.trial_setup import TrialSetup
from wayfarer.hal import MotorHealth, PositionFix, Snapshot, WheelCommand
from wayfarer.safety.conditions import Condition, Level
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.simulated_world import SimulatedWorld


class RecordedTick(NamedTuple):
    """One control tick."""

    t_s: float
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
    details: dict[str, object]


class RunRecorder:
    """Keeps what a run reports; implements ``control.run_log.RunLog``. ``follow`` gives it the trial to watch."""

    def __init__(self) -> None:
        self.ticks: list[RecordedTick] = []
        self.events: list[RecordedEvent] = []
        self.boards: list[tuple[float, tuple[MotorHealth, WheelCommand | None]]] = []
        self.fixes: list[PositionFix | None] = []
        self.faults: list[tuple[float, Fault, bool]] = []
        self.stood_still_s: list[tuple[float, bool]] = []
        self.ended: str | None = None
        self.ended_s = inf

    def follow(self, setup: TrialSetup) -> None:
        """Watch a trial's world and its controller."""
        self._controller, self._world = setup.supervisor.controller, setup.world
        after_each_step(setup.world, self._look)

    def _look(self) -> None:
        if self.ended is None:  # wheels that stand after the end of a run say nothing of the fault
            self.stood_still_s.append((self._world.t_s, self._world.commanded == (0.0, 0.0)))

    def tick(self, record: TickRecord) -> None:
        """Take a control tick."""
        self.ticks.append(
            RecordedTick(
                record.t_s,
                record.snapshot,
                record.level,
                record.cause,
                self._controller.conditions,
                record.decision.why,
                record.applied,
                self._world.commanded,
            )
        )

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take an event; the stop at the end of a run is looked at as well."""
        self.events.append(RecordedEvent(t_s, name, details))
        if name == "wheels_stopped":
            self.stood_still_s.append((_now_s(), self._world.commanded == (0.0, 0.0)))

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


def after_each_step(world: SimulatedWorld, look: Callable[[], None]) -> None:
    """Have ``look`` called after each step of a world, before what is called already."""
    others = world.after_step

    def look_first(moved: SimulatedWorld) -> None:
        look()
        others(moved)

    world.after_step = look_first


def _now_s() -> float:
    return asyncio.get_running_loop().time()
