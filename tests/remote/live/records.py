"""Records as a daemon shows them, made by its own log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wayfarer.config.rover_file import load_rover
from wayfarer.control.modes import Mode
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Anomaly, Decision, Observation, Phase
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import STOP, CompassReading, MotionReading, MotorHealth, WheelCommand
from wayfarer.safety.conditions import Condition, Level

WORLD = {
    "forest": 1, "noise": 0, "start_m": [25.0, 12.5], "heading_deg": 0.0, "goal_y_m": 50.0,
    "trunk_diameter_m": 0.3, "tree_radius_m": 0.25,
    "trees_m": [[8.9, 26.2]], "trunks_m": [[33.3, 5.5, 30.9, 18.4, "left"]],
}  # fmt: skip


class NoDisk(Sink):
    """A sink that keeps nothing."""

    def __init__(self) -> None:
        super().__init__(Path("nowhere"))

    def open(self, header: Any) -> None: ...

    def put(self, line: bytes, urgent: bool = False) -> None: ...

    def close(self) -> None: ...


def run_log(
    *viewers: Any,
    simulated: bool = True,
    parts: tuple[str, ...] = ("compass", "motion", "motors"),
    trial: int | None = None,
) -> FieldLog:
    """Return a run's log whose records go to viewers."""
    about = {
        "rover": "sim", "algorithm": "forest-pledge", "simulated": simulated, "dry_run": False, "log": "logs/1",
        "trial": trial, "parts": dict.fromkeys(parts, "a part"), "config": load_rover("sim").model_dump(mode="json"),
    }  # fmt: skip
    return FieldLog(NoDisk(), about | ({"world": WORLD} if simulated else {}), t_s=100.0, viewers=viewers)


def tick(
    t_s: float,
    *,
    heading_deg: float | None = 90.0,
    phase: Phase = Phase.FOLLOW,
    why: str | None = None,
    anomalies: tuple[Anomaly, ...] = (),
    moved_m: float | None = 0.05,
    travelled_m: float = 0.0,
    level: Level = Level.WELL,
    cause: Condition | None = None,
    memory: Any = None,
    wheels: WheelCommand = STOP,
    mode: str = "disarmed",
    north_m: float | None = None,
    east_m: float | None = None,
    **known: Any,
) -> TickRecord:
    """Return one control tick; ``known`` are hold, mission and goal."""
    compass = None if heading_deg is None else CompassReading(t_s, heading_deg, 1.0, -1.0, 3)
    motion = None if moved_m is None else MotionReading(t_s, moved_m, 0.0, 0.8)
    seen = None
    if heading_deg is not None:
        seen = Observation(t_s, heading_deg, 1.0, -1.0, anomalies, None, 0.0, travelled_m)
    decision = Decision(wheels, phase, why or phase.value)
    kept = {"counter_deg": 30.0, "episodes": 2} if memory is None else memory
    record = TickRecord(t_s)
    record.compass, record.motion, record.observation = compass, motion, seen
    record.decision, record.applied = decision, wheels
    record.level, record.cause = level, cause
    record.memory = lambda: kept
    record.mode, record.north_m, record.east_m = Mode(mode), north_m, east_m
    for key, value in known.items():
        setattr(record, key, value)
    return record


def board(battery_v: float | None = 12.0, *faults: str) -> MotorHealth:
    """Return what a motor board says."""
    return MotorHealth(battery_v, faults)
