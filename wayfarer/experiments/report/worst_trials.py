"""Selects the trials that a report draws, and runs them again to get their paths."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing
from functools import partial
from itertools import chain, zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from wayfarer.errors import WayfarerError
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.executors import Done, TrialRunner, stream
from wayfarer.experiments.progress_bar import ProgressDisplay
from wayfarer.experiments.rows import SUCCESSES, TrialRow
from wayfarer.experiments.trajectory import Trace, run_traced
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec


class RerunTrial(NamedTuple):
    """A trial that was run again: its way, or why the way that it took this time is not the one in the table."""

    row: TrialRow
    trace: Trace | None
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


def run_again(campaign: Campaign, rows: Sequence[TrialRow], jobs: int, progress: ProgressDisplay) -> list[RerunTrial]:
    """Run these trials of a campaign again, and return them with their ways, in the same order.

    Raises:
        WayfarerError: a worker process died.
    """
    with TemporaryDirectory(prefix="wayfarer-") as name:
        runner = TrialRunner(campaign, partial(_trace_into, Path(name)))
        tasks = [Task(*row.key) for row in rows]
        done: dict[tuple[str, int], Done] = {}
        try:
            with closing(stream(runner, tasks, max(1, min(jobs, len(tasks))), threading.Event())) as finished:
                for each in finished:
                    done[each.row.key] = each
                    progress.advance(each)
        except BrokenExecutor as error:
            raise WayfarerError(
                "a worker process died while trials were run again, most likely for want of memory; try --jobs 1"
            ) from error
        return [_compare(row, done[row.key], Path(name)) for row in rows]


def _trace_into(folder: Path, spec: TrialSpec, _log_dir: Path | None = None) -> TrialResult:
    """Run a trial and leave its way in a file, for the process that asked for it."""
    result, trace = run_traced(spec)
    _file(folder, (spec.algorithm, spec.trial)).write_bytes(pickle.dumps(trace))
    return result


def _file(folder: Path, key: tuple[str, int]) -> Path:
    return folder / f"{key[1]}-{key[0]}"


def _compare(row: TrialRow, done: Done, folder: Path) -> RerunTrial:
    """Return the way only where the trial came out as in the table, in every column."""
    if done.fault is not None:
        return RerunTrial(row, None, f"cannot be run again: {done.fault.text}")
    again = done.row._replace(ticks=None)
    if row.overturned is None:  # a table of an older version counts all kinds together
        again = again._replace(overturned=None, off_wheels=None)
    if again != row:
        return RerunTrial(row, None, _difference(row, again))
    return RerunTrial(row, pickle.loads(_file(folder, row.key).read_bytes()))


def _difference(row: TrialRow, again: TrialRow) -> str:
    """Say how two runs of a trial differ: by their ends, or by the first column that is not the same."""
    if ending(row) != ending(again):
        return f"{ending(row)} in the table, {ending(again)} now"
    name = next(name for name in TrialRow._fields if name != "ticks" and getattr(row, name) != getattr(again, name))
    return f"{name} is {getattr(row, name)} in the table and {getattr(again, name)} now"


def ending(row: TrialRow) -> str:
    """Say how a trial ended, and after which path."""
    outcome = {"left_bounds": "out over another edge"}.get(row.outcome, row.outcome)
    return outcome if row.path_m is None else f"{outcome} after {row.path_m:.1f} m"
