"""Implementation of ``wayfarer sweep`` after its options are parsed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from wayfarer.experiments.checks import INTERRUPTED
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.run import RunTrial
from wayfarer.experiments.sim_command import kept_in, run_shown
from wayfarer.experiments.sweep import Sweep
from wayfarer.experiments.tables import SWEEP_COLUMNS, layouts_note, results_table
from wayfarer.logview.terminal import print_json, say_next
from wayfarer.logview.terminal_table import print_whole


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
    cells = sorted(finished.cells, key=lambda cell: sweep.base.algorithms.index(cell[1]))
    lines = [((name, *(str(value) for value in at.values())), rows) for at, name, rows in cells]
    # A word a line: two long keys must fit 80 columns.
    keys = [axis.key.rpartition(".")[2].replace("_", "\n") for axis in sweep.axes]
    print_whole(console, results_table(("algorithm", *keys), lines, SWEEP_COLUMNS, {}, full=False))
    console.print(layouts_note(sweep.settings()), markup=False, highlight=False)
    say(Console(stderr=True), f"the results are in {out}")
    say_next("wayfarer", "report", out)
    return 0
