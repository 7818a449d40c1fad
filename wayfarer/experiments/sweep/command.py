"""Implementation of ``wayfarer sweep`` after its options are parsed."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import BrokenExecutor
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from wayfarer.errors import WayfarerError
from wayfarer.experiments.commands import INTERRUPTED
from wayfarer.experiments.executors import RunTrial, field_trial
from wayfarer.experiments.progress_bar import say, shown_progress
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.sweep.folder import SweepFolder
from wayfarer.experiments.sweep.grid import PointTask, Sweep
from wayfarer.experiments.sweep.measures import MEASURES, by_cell
from wayfarer.experiments.sweep.run import run

LEGEND = "success: escaped or left the map; path: mean of the successes; the report has the 95 % intervals"


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
    console.print(_table(sweep, rows))
    say(console, LEGEND)
    say(aside, f"the results are in {out}; `wayfarer report {out}` draws them")
    return 0


def _table(sweep: Sweep, rows: Mapping[PointTask, TrialRow]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 0, 0, 1))
    swept = [axis.key.rpartition(".")[2] for axis in sweep.axes]
    for title in ("algorithm", *swept, *(measure.title for measure in MEASURES)):
        table.add_column(title.replace(", ", "\n"), justify="left" if title == "algorithm" else "right", no_wrap=True)
    for (point, name), found in sorted(by_cell(rows).items(), key=lambda cell: sweep.base.algorithms.index(cell[0][1])):
        estimates = ["" if (e := m.of(found)) is None else f"{e.value:.{m.decimals}f}" for m in MEASURES]
        table.add_row(name, *map(str, sweep.points[point].values), *estimates)
    return table
