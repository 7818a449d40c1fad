"""Runs a sweep: all points in one pool."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing, suppress
from typing import NamedTuple

from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.executors import Done, RunTrial, Stopped, TrialRunner, field_trial, stream
from wayfarer.experiments.progress_bar import ProgressDisplay
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.run_campaign import stop_on_signals
from wayfarer.experiments.sweep.folder import SweepFolder
from wayfarer.experiments.sweep.grid import PointTask, Sweep


class PointDone(NamedTuple):
    """A finished trial of a point."""

    point: int
    done: Done


class SweepRunner:
    """Runs the trials of all points; what it needs can be sent to another process."""

    def __init__(self, campaigns: Sequence[Campaign], run_trial: RunTrial = field_trial) -> None:
        self._points = [TrialRunner(campaign, run_trial) for campaign in campaigns]

    def run_chunk(self, tasks: Sequence[PointTask]) -> list[PointDone]:
        """Run several trials."""
        return [PointDone(point, self._points[point].run(Task(name, trial))) for point, name, trial in tasks]


def run(
    sweep: Sweep,
    folder: SweepFolder,
    *,
    jobs: int = 1,
    progress: ProgressDisplay | None = None,
    run_trial: RunTrial = field_trial,
) -> dict[PointTask, TrialRow]:
    """Run the trials that ``folder`` does not hold yet, and write the final files when none is missing.

    Results do not depend on ``jobs``, the number of processes. What is returned is in the order of ``trials.csv``;
    after an interruption trials are missing.

    Raises:
        BrokenExecutor: a worker died; finished trials are kept.
        WayfarerError: the folder cannot be written any more; finished trials are kept.
    """
    rows = dict(folder.kept)
    todo = [task for task in sweep.tasks_by_forest() if task not in rows]
    runner, jobs = SweepRunner([point.campaign for point in sweep.points], run_trial), max(1, min(jobs, len(todo)))
    progress = progress or ProgressDisplay()
    with (
        stop_on_signals() as stop,
        suppress(Stopped),
        closing(stream(runner, todo, jobs, stop)) as finished,
    ):
        for point, done in finished:
            rows[PointTask(point, done.row.algorithm, done.row.trial)] = done.row
            folder.append(point, done.row)
            progress.advance(done)
    ordered = {task: rows[task] for task in sweep.tasks() if task in rows}
    if len(ordered) == len(sweep.tasks()):
        folder.finish(sweep, ordered)
    return ordered
