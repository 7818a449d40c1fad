"""Implementation of ``wayfarer sweep`` after its options are parsed."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from wayfarer.errors import WayfarerError
from wayfarer.experiments.commands import INTERRUPTED
from wayfarer.experiments.executors import RunTrial, field_trial
from wayfarer.experiments.progress_bar import say, shown_progress
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.sweep.folder import SweepFolder
from wayfarer.experiments.sweep.grid import Sweep
from wayfarer.experiments.sweep.measures import MEASURES, Measure, by_cell
from wayfarer.experiments.sweep.run import run
from wayfarer.views.text.terminal_table import Column, table

LEGEND = "success: escaped or left the map; path: mean of the successes; the report has the 95 % intervals"


class _Cell(NamedTuple):
    """What one algorithm did at one point."""

    point: int
    algorithm: str
    rows: list[TrialRow]


def run_all(sweep: Sweep, out: Path, *, resume: bool = False, jobs: int = 1, run_trial: RunTrial = field_trial) -> int:
    """Run a sweep, show it, print its table, and return the exit code.

    Raises:
        BadInput: ``out`` cannot be used.
        WayfarerError: a worker died, or ``out`` cannot be written any more; finished trials are kept.
    """
    aside, total = Console(stderr=True), len(sweep.tasks())
    with SweepFolder(out, sweep, resume=resume) as folder:
        if folder.kept:
            say(aside, f"{len(folder.kept)} of {total} trials are in {out} already")
        try:
            with shown_progress(aside, len(folder.kept), total) as progress:
                rows = run(sweep, folder, jobs=jobs, progress=progress, run_trial=run_trial)
        except BrokenExecutor as error:
            raise WayfarerError(
                f"a worker process died, most likely for want of memory; what is in {out} is safe: "
                "add --resume, with fewer --jobs"
            ) from error
    if len(rows) < total:
        say(aside, f"interrupted: {len(rows)} of {total} trials are kept in {out}; add --resume to go on")
        return INTERRUPTED
    console = Console()
    cells = [_Cell(point, name, found) for (point, name), found in by_cell(rows).items()]
    cells.sort(key=lambda cell: sweep.base.algorithms.index(cell.algorithm))
    console.print(table(list(_columns(sweep)), cells))
    say(console, LEGEND)
    say(aside, f"the results are in {out}; `wayfarer report {out}` draws them")
    return 0


def _columns(sweep: Sweep) -> Iterator[Column[_Cell]]:
    yield Column("algorithm", lambda cell: cell.algorithm, left=True)
    for number, axis in enumerate(sweep.axes):
        yield Column(axis.key.rpartition(".")[2], partial(_swept, sweep, number))
    for measure in MEASURES:
        yield Column(measure.title.replace(", ", "\n"), partial(_measured, measure))


def _swept(sweep: Sweep, number: int, cell: _Cell) -> str:
    return str(sweep.points[cell.point].values[number])


def _measured(measure: Measure, cell: _Cell) -> str:
    estimate = measure.of(cell.rows)
    return "" if estimate is None else f"{estimate.value:.{measure.decimals}f}"
