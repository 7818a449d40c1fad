"""Selects the trials that a report draws, and runs them again to get their paths.

No rover knows its own position. A trajectory is what a log sees that looks at the simulated world beside the rover's
records; it is thinned while it is read, because an entrapped rover takes 80,000 ticks.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from itertools import chain, zip_longest
from math import hypot
from typing import NamedTuple

from wayfarer.control.run_log import PartialLog
from wayfarer.control.tick import TickRecord
from wayfarer.errors import kind_and_text
from wayfarer.escape.api import Phase
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.pool import TaskFailed, run_tasks
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.run import TrialRunner, not_run
from wayfarer.experiments.trial import TrialResult, run_watched
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.hal import Rover
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.vocabulary import outcome_in_words

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


class RerunTrial(NamedTuple):
    """A trial that was run again: its path, or why the path that it took this time is not the one in the table."""

    row: TrialRow
    trajectory: Trajectory | None
    why_not: str = ""


def choose(by_algorithm: Mapping[str, Sequence[TrialRow]], count: int) -> list[TrialRow]:
    """Return up to ``count`` trials worth looking at: failures first, then the longest paths.

    Every algorithm has its turn before one has a second. A trial of unknown path, as after a crash, is not chosen.
    """
    worst_first = [sorted((row for row in rows if row.path_m), key=_worst) for rows in by_algorithm.values()]
    turns = ([row for row in turn if row is not None] for turn in zip_longest(*worst_first))
    chosen = list(chain.from_iterable(sorted(turn, key=_worst) for turn in turns))[:count]
    return sorted(chosen, key=_worst)


def _worst(row: TrialRow) -> tuple[bool, float, int]:
    return row.outcome in SUCCESSES, -(row.path_m or 0.0), row.trial


def run_again(
    campaign: Campaign, rows: Sequence[TrialRow], jobs: int, progress: Callable[[object], object]
) -> list[RerunTrial]:
    """Run these trials of a campaign again, and return them with their trajectories, in the same order.

    ``progress`` is called with each trial when it is done.

    Raises:
        TrialNotRun: a worker process died.
    """
    found: dict[tuple[str, int, int], RerunTrial] = {}
    try:
        with closing(run_tasks(partial(_rerun, campaign), rows, jobs=jobs, stop=threading.Event())) as finished:
            for again in finished:
                found[again.row.key] = again
                progress(again)
    except TaskFailed as failed:
        raise not_run(failed, "use --jobs 1, or --gallery 0 for a report without it") from failed.error
    return [found[row.key] for row in rows]


def _rerun(campaign: Campaign, row: TrialRow) -> RerunTrial:
    """Run a trial; give its path only if it has the result of the table, in every column."""
    trajectories: list[Trajectory] = []

    def run_trial(spec: TrialSpec) -> TrialResult:
        result, trajectory = run_with_trajectory(spec)
        trajectories.append(trajectory)
        return result

    try:
        done = TrialRunner(campaign, run_trial=run_trial)(Task(*row.key))
    except (Exception, SystemExit) as error:  # an algorithm of a third party may raise anything
        return RerunTrial(row, None, f"cannot be run again: {kind_and_text(error)}")
    return RerunTrial(row, trajectories[0]) if done.row == row else RerunTrial(row, None, _difference(row, done.row))


def _difference(row: TrialRow, again: TrialRow) -> str:
    """Say how two runs of a trial differ: by their ends, or by the first column that is not the same."""
    if ending(row) != ending(again):
        return f"{ending(row)} in the table, {ending(again)} now"
    name = next(name for name in TrialRow._fields if name != "ticks" and getattr(row, name) != getattr(again, name))
    return f"{name} is {getattr(row, name)} in the table and {getattr(again, name)} now"


def ending(row: TrialRow) -> str:
    """Say how a trial ended, and after which path."""
    outcome = outcome_in_words(row.outcome)
    return outcome if row.path_m is None else f"{outcome} after {row.path_m:.1f} m"


# -- the path of one trial ---------------------------------------------------------------------------------------------


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
