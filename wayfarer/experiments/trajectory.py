"""Runs a trial again to record its true path, with phases and slips.

No rover knows its own position. A trajectory is what a log sees that looks at the simulated world beside the rover's
records; it is thinned while it is read, because an entrapped rover takes 80,000 ticks.
"""

from __future__ import annotations

from math import hypot
from typing import NamedTuple

from wayfarer.control.run_log import PartialLog
from wayfarer.control.tick_record import TickRecord
from wayfarer.escape.api import Phase
from wayfarer.experiments.trial import TrialResult, run_watched
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.hal import Rover
from wayfarer.simhal.world.simulated_world import SimulatedWorld

KEPT_EVERY_M = 0.2  # half a body: the tightest curve, the probe's, has a radius of 1.15 m


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


class TrajectoryLog(PartialLog):
    """Looks at the world at each tick, and keeps every change of phase, and between them every ``KEPT_EVERY_M``."""

    def __init__(self, world: SimulatedWorld) -> None:
        self.trajectory = Trajectory([], [])
        self._world = world
        self._slipping = False

    def tick(self, record: TickRecord) -> None:
        """Look where the rover is."""
        world, points = self._world, self.trajectory.points
        if world.slipping and not self._slipping:
            self.trajectory.slips_m.append((world.x_m, world.y_m))
        self._slipping = world.slipping
        here = self._point(record.decision.phase)
        last = points[-1] if points else None
        if (
            last is None
            or here.phase is not last.phase
            or hypot(here.x_m - last.x_m, here.y_m - last.y_m) >= KEPT_EVERY_M
        ):
            points.append(here)

    def _point(self, phase: Phase) -> TrajectoryPoint:
        world = self._world
        return TrajectoryPoint(world.x_m, world.y_m, phase, world.t_s)

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002
        """Keep where it ended."""
        self.trajectory.points.append(self._point(Phase.HALT))


def run_with_trajectory(spec: TrialSpec) -> tuple[TrialResult, Trajectory]:
    """Run one trial, and return its result, which is the same as in the campaign, with its trajectory.

    Raises:
        MissingPart: the rover cannot give what the algorithm needs.
    """
    logs: list[TrajectoryLog] = []

    def make_log(world: SimulatedWorld, _: Rover) -> TrajectoryLog:
        logs.append(TrajectoryLog(world))
        return logs[0]

    return run_watched(spec, make_log), logs[0].trajectory
