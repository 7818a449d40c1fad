"""One trial: the daemon's own supervisor on a simulated rover in one forest, watched by a referee."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from wayfarer.config import RoverConfig
from wayfarer.escape.api import Phase
from wayfarer.hal import PositionFix
from wayfarer.mission import RunEnd
from wayfarer.records import RunLog, Tee, TickRecord
from wayfarer.registry import find_algorithm
from wayfarer.simhal.forest import Forest
from wayfarer.simhal.loop import VirtualLoop
from wayfarer.simhal.physics import Physics
from wayfarer.simhal.referee import Outcome, Referee
from wayfarer.simhal.rig import Depth, build
from wayfarer.simhal.streams import Streams
from wayfarer.simhal.world import World
from wayfarer.supervisor import Supervisor


@dataclass(frozen=True, slots=True)
class TrialSpec:
    """Everything that decides a trial: the same spec gives the same result, on any worker."""

    trial: int
    algorithm: str
    forest: Forest
    seed: int
    rover: RoverConfig
    slip_mean_m: float = 10.0
    budget_m: float = 1000.0
    depth: Depth = Depth.DEVICE


class TrialResult(NamedTuple):
    """What the referee says of one trial."""

    trial: int
    algorithm: str
    forest: int
    noise: int
    seed: int
    outcome: Outcome
    path_m: float
    reverse_m: float
    time_s: float
    anomalies: int
    episodes: int
    shortest_path_m: float | None
    spl: float | None
    ticks: int


class Tally:
    """A run log that counts and keeps nothing."""

    def __init__(self) -> None:
        self.ticks = 0
        self.anomalies = 0
        self.episodes = 0
        self.disarmed = False
        self._phase = Phase.HALT

    def tick(self, record: TickRecord) -> None:
        """Count the tick, and each phase that an anomaly began."""
        self.ticks += 1
        phase = record.decision.phase
        if phase is not self._phase:
            self._count(phase)

    def _count(self, phase: Phase) -> None:
        if phase is Phase.BACK_OFF:
            self.anomalies += 1
            self.episodes += self._phase is Phase.FOLLOW
        self._phase = phase

    def event(self, name: str, t_s: float, **details: object) -> None:  # noqa: ARG002
        """Note a rover that gave up by itself."""
        self.disarmed |= name == "disarmed"

    def position(self, fix: PositionFix | None) -> None:
        """Positions are not counted."""

    def close(self, reason: str, text: str) -> None:
        """There is nothing to close."""


def run_trial(spec: TrialSpec, log_dir: Path | None = None) -> TrialResult:
    """Run one trial; with ``log_dir`` the rover's full field log is written there.

    Raises:
        MissingPart: the rover cannot give what the algorithm needs.
        BadInput: the log cannot be written.
    """
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(_run(spec, log_dir))


async def _run(spec: TrialSpec, log_dir: Path | None) -> TrialResult:
    streams = Streams(spec.seed)
    algorithm = find_algorithm(spec.algorithm)
    handler = algorithm.make(spec.rover.escape, spec.rover.vehicle, streams.random("algorithm"))
    physics = replace(Physics(), slip_mean_m=spec.slip_mean_m)
    world = World(spec.forest, spec.rover.vehicle, physics, streams)
    rover = build(spec.depth, world, streams, spec.rover, asyncio.get_running_loop().time)
    tally = Tally()
    log = tally if log_dir is None else Tee(tally, _field_log(spec, log_dir))
    supervisor = Supervisor(rover, spec.rover, algorithm, handler, log)
    referee = Referee(spec.forest, spec.budget_m, physics.tip_deg, supervisor.finish)
    world.after_step = referee.watch
    await supervisor.arm(spec.forest.heading_deg)
    end = await supervisor.run()
    return _result(spec, _outcome(referee, tally, end), referee, world, tally)


def _outcome(referee: Referee, tally: Tally, end: RunEnd) -> Outcome:
    """Return how a trial ended; a rover that used up its own mission's limits did not get out either."""
    if tally.disarmed:
        return "fault"
    return referee.outcome or ("entrapped" if end.reason.startswith("mission_") else "fault")


def _field_log(spec: TrialSpec, folder: Path) -> RunLog:
    """Return the log that a rover in the field writes; its wall clock is the trial's, so that it can be reproduced."""
    from wayfarer.fieldlog import FieldLog  # a thousand trials without a log need neither structlog nor orjson

    forest = spec.forest
    details = {
        "algorithm": spec.algorithm,
        "rover": spec.rover.name,
        "config": spec.rover.model_dump(mode="json"),
        "trial": spec.trial,
        "forest": forest.forest,
        "noise": forest.noise,
        "seed": spec.seed,
        "slip_mean_m": spec.slip_mean_m,
        "budget_m": spec.budget_m,
    }
    return FieldLog(folder, details, wall=lambda t_s: t_s)


def _result(spec: TrialSpec, outcome: Outcome, referee: Referee, world: World, tally: Tally) -> TrialResult:
    forest = spec.forest
    path_m = referee.path_m(world)
    shortest_m = forest.shortest_path_m
    succeeded = outcome in ("escaped", "left_bounds")
    spl = None if shortest_m is None else shortest_m / max(shortest_m, path_m) if succeeded else 0.0
    return TrialResult(
        spec.trial,
        spec.algorithm,
        forest.forest,
        forest.noise,
        spec.seed,
        outcome,
        path_m,
        world.reverse_m,
        world.t_s,
        tally.anomalies,
        tally.episodes,
        shortest_m,
        spl,
        tally.ticks,
    )
