"""The log of a simulated run: what a rover in the field writes, and beside it the rover's true pose and its faults.

No rover knows its own position: ``GroundTruthLog`` and ``TrackLog`` look at the simulated world beside its records.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from math import degrees, dist, inf
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import msgspec

from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Phase
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.record import AnyRecord, FaultInjected, Truth, World
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import Rover
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest_file import as_row
from wayfarer.simhal.world.physics import GroundName, changed
from wayfarer.simhal.world.simulated_world import SimulatedWorld

if TYPE_CHECKING:
    from wayfarer.simhal.faults.kinds import Fault

TICKS_A_RECORD = 4  # a fifth of a second at 20 Hz: plenty to draw a path
KEPT_EVERY_M = 0.2  # half a body: the tightest curve, the probe's, has a radius of 1.15 m


def field_log(
    spec: TrialSpec,
    folder: Path,
    world: SimulatedWorld,
    rover: Rover,
    viewers: Sequence[Callable[[AnyRecord], object]] = (),
) -> tuple[FieldLog, GroundTruthLog]:
    """Return the log that a rover in the field writes, and who writes the truth beside it.

    Its wall clock is the trial's, and it is written as it comes, without a thread: the same trial gives the same bytes.
    ``viewers`` are shown each record.
    """
    forest = spec.forest
    details = {
        "algorithm": spec.algorithm,
        "rover": spec.rover.name,
        "config": spec.rover.model_dump(mode="json"),
        "trial": spec.trial,
        "forest": forest.forest,
        "noise": forest.noise,
        "seed": spec.seed,
        "algorithm_seed": RandomStreams(spec.seed).random_seed("algorithm"),
        "ladder_seed": RandomStreams(spec.seed).random_seed("ladder"),
        "simulated": True,
        "parts": {name: part.name for name, part in rover.parts.items()},
        "world": msgspec.convert(as_row(forest), World),
        "budget_m": spec.budget_m,
    }
    if spec.files:
        details["files"] = {name: file._asdict() for name, file in spec.files.items()}
    if spec.terrain is not None:
        details["mujoco"] = asdict(spec.terrain)
    if spec.ground is not GroundName.ideal:
        details["ground"] = spec.ground.value
    if of_world := changed(spec.physics):
        details["sim"] = of_world
    log = FieldLog(Sink(folder), details, wall=lambda t_s: t_s, viewers=viewers)
    return log, GroundTruthLog(log, world)


class GroundTruthLog(RunLog):
    """Writes ``truth`` beside the ticks: regularly, and whenever the rover begins or ceases to slip or to touch.

    Injected faults are ground truth too: ``note`` writes ``fault`` when one begins or ends.
    """

    def __init__(self, log: FieldLog, world: SimulatedWorld) -> None:
        self._log = log
        self._world = world
        self._ticks = 0
        self._last = (False, False)

    def event(self, name: str, t_s: float, **_details: object) -> None:
        """Look at the world once more when the wheels have stopped for good."""
        if name == "wheels_stopped":
            self._log.note(Truth, t_s, _truth(self._world))

    def tick(self, record: TickRecord) -> None:
        """Look at the world at a control tick."""
        world = self._world
        happening = (world.slipping, world.touch is not None)
        if self._ticks % TICKS_A_RECORD == 0 or happening != self._last:
            self._log.note(Truth, record.t_s, _truth(world))
        self._ticks += 1
        self._last = happening

    def note(self, t_s: float, fault: Fault, *, begins: bool) -> None:
        """Take the beginning of a fault, or its end; implements ``simhal.faults.injector.NoteFault``."""
        about = {"target": fault.target, "kind": fault.kind, "begins": begins}
        lasting_s = fault.for_s if fault.for_s < inf else None
        self._log.note(FaultInjected, t_s, {**about, "for_s": lasting_s, "params": asdict(fault.params)})


def _truth(world: SimulatedWorld) -> dict[str, float | bool]:
    """Return the pose in the forest's own metres, x east and y north, the way so far, and what holds the rover."""
    return {
        "x_m": round(world.x_m, 4),
        "y_m": round(world.y_m, 4),
        "heading_deg": round(degrees(world.heading_rad) % 360.0, 2),
        "pitch_deg": round(world.pitch_deg, 2),
        "roll_deg": round(world.roll_deg, 2),
        "driven_m": round(world.path_m, 3),
        "slipping": world.slipping,
        "touching": world.touch is not None,
    }


# -- the true path, in memory ------------------------------------------------------------------------------------------


class TrackRow(NamedTuple):
    """Where the rover truly was at a control tick, what it saw, and what it did."""

    t_s: float
    x_m: float
    y_m: float
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    slipping: bool
    touching: bool
    phase: str
    why: str
    anomalies: str
    left: float
    right: float


class TrajectoryPoint(NamedTuple):
    """Where the rover was, metres east and north, and what it was doing from there on."""

    x_m: float
    y_m: float
    phase: Phase
    t_s: float = 0.0


class Trajectory(NamedTuple):
    """The path of one trial: its points in the order of time, and where the ground gave way."""

    points: list[TrajectoryPoint]
    slips_m: list[tuple[float, float]]


class TrackLog(RunLog):
    """Keeps the true pose and the decision at each control tick; ``run_trial`` gives it the ``world`` to look at."""

    world: SimulatedWorld

    def __init__(self) -> None:
        self.ticks: list[TrackRow] = []

    def tick(self, record: TickRecord) -> None:
        """Look at the world at a control tick."""
        world, decision = self.world, record.decision
        self.ticks.append(
            TrackRow(
                record.t_s, world.x_m, world.y_m, degrees(world.heading_rad) % 360.0, world.pitch_deg, world.roll_deg,
                world.slipping, world.touch is not None, decision.phase.value, decision.why,
                "+".join(anomaly.value for anomaly in record.anomalies), *record.applied,
            )
        )  # fmt: skip

    def trajectory(self) -> Trajectory:
        """Return the path for a drawing: each change of phase, a point every ``KEPT_EVERY_M`` between, and the end.

        An entrapped rover takes 80,000 ticks, too many for a page.
        """
        points, slips_m, slipping = list[TrajectoryPoint](), list[tuple[float, float]](), False
        for tick in self.ticks:
            here = TrajectoryPoint(tick.x_m, tick.y_m, Phase(tick.phase), tick.t_s)
            last = points[-1] if points else None
            if last is None or here.phase is not last.phase or dist(here[:2], last[:2]) >= KEPT_EVERY_M:
                points.append(here)
            if tick.slipping and not slipping:
                slips_m.append((tick.x_m, tick.y_m))
            slipping = tick.slipping
        end = self.world
        return Trajectory([*points, TrajectoryPoint(end.x_m, end.y_m, Phase.HALT, end.t_s)], slips_m)
