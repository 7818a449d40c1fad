"""Implementation of ``wayfarer sweep`` after its options are parsed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from wayfarer.experiments.commands import INTERRUPTED
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.run import RunTrial
from wayfarer.experiments.sim_command import kept_in, run_shown
from wayfarer.experiments.statistics import AlgorithmSummary
from wayfarer.experiments.sweep import Sweep, Value
from wayfarer.experiments.tables import number_text, spl_hint
from wayfarer.logview.terminal import print_json, say_next
from wayfarer.logview.terminal_table import Column, known, table

LEGEND = """success: escaped or left the map; path, time: mean of the successes
the report has the 95 % intervals"""


class _Cell(NamedTuple):
    """What one algorithm did at one point."""

    values: Mapping[str, Value]
    summary: AlgorithmSummary


def run_all(
    sweep: Sweep,
    out: Path,
    *,
    resume: bool = False,
    jobs: int = 1,
    as_json: bool = False,
    command: Sequence[str] | None = None,
    run_trial: RunTrial | None = None,
) -> int:
    """Run a sweep, show it, print its table or the same as JSON, and return the exit code.

    ``command`` is the command line, which the folder keeps.

    Raises:
        BadInput: ``out`` cannot be used.
        TrialNotRun: a trial raised an error, or ended its worker; finished trials are kept.
        WayfarerError: ``out`` cannot be written any more; finished trials are kept.
    """
    with kept_in(out, sweep, resume=resume, command=command) as folder:
        finished = run_shown(sweep, folder, jobs=jobs, run_trial=run_trial)
    if finished.interrupted:
        return INTERRUPTED
    if as_json:
        print_json(finished.as_json())
        return 0
    console = Console()
    cells = list(map(_Cell, finished.points, finished.summaries))
    cells.sort(key=lambda cell: sweep.base.algorithms.index(cell.summary.algorithm))
    console.print(table(known(list(_columns(sweep)), cells), cells))
    say(console, LEGEND)
    if hint := spl_hint(finished.summaries):
        say(console, hint)
    say(Console(stderr=True), f"the results are in {out}")
    say_next("wayfarer", "report", out)
    return 0


def _columns(sweep: Sweep) -> Iterator[Column[_Cell]]:
    yield Column("algorithm", lambda cell: cell.summary.algorithm, left=True)
    for axis in sweep.axes:
        title = axis.key.rpartition(".")[2].replace("_", "\n")  # a word a line: two long keys must fit 80 columns
        yield Column(title, partial(_value, axis.key))
    yield Column("success\n%", lambda cell: number_text(cell.summary.success_percent))
    yield Column("SPL", lambda cell: number_text(cell.summary.spl, 3), if_known=True)
    yield Column("path\nm", lambda cell: number_text(cell.summary.path_mean_m))
    yield Column("time\ns", lambda cell: number_text(cell.summary.escape_mean_s))
    yield Column("left the\nmap %", lambda cell: number_text(100 * cell.summary.left_bounds / cell.summary.trials))
    yield Column("interv.\na trial", lambda cell: number_text(cell.summary.interventions_mean, 2), if_known=True)


def _value(key: str, cell: _Cell) -> str:
    return str(cell.values[key])
