"""What ``wayfarer sim`` and ``wayfarer sweep`` do once their options are read: run trials, and print a table."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import partial
from pathlib import Path
from threading import Event
from traceback import format_exception
from typing import TYPE_CHECKING, Any

from rich.console import Console

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign, Plan, Task
from wayfarer.experiments.checks import make_empty_folder
from wayfarer.experiments.measures import summarise
from wayfarer.experiments.pool import TaskFailed, cores, run_tasks
from wayfarer.experiments.results import Results
from wayfarer.experiments.rows import csv_line, rounded_values
from wayfarer.experiments.run import ComputeCost, RunTrial, TrialRunner, not_run, run
from wayfarer.experiments.tables import layouts_note, table_of
from wayfarer.logview.progress_bar import say, shown_progress
from wayfarer.logview.terminal import print_json, say_next
from wayfarer.logview.terminal_table import print_whole
from wayfarer.simhal.world.forest_file import content_of

if TYPE_CHECKING:
    from wayfarer.experiments.dask_cluster import Cluster

INTERRUPTED = 130  # as a shell reports a command that SIGINT ended
TRACEBACK_FILE = "traceback.txt"


def run_all(
    plan: Plan,
    out: Path | None,
    *,
    resume: bool = False,
    jobs: int | None = None,
    cluster: str | None = None,
    forests: str | Path | None = None,
    log: Path | None = None,
    as_json: bool = False,
    command: Sequence[str] | None = None,
    run_trial: RunTrial | None = None,
) -> int:
    """Run a campaign or a sweep, show it, print its table, or with ``as_json`` an object, and return the exit code.

    ``forests`` is what the campaign's forests were read from (``read_forest_file``); ``out`` keeps a copy, and
    ``command``, the command line.
    With ``log`` each trial's full field log goes into a separate folder there. With ``cluster``, the address of a
    Dask scheduler, the trials run on its workers, else in ``jobs`` processes.

    Raises:
        BadInput: ``out`` cannot be used, there is no such cluster, or ``log`` is not new or empty.
        TrialNotRun: a trial raised an error, or ended its worker; finished trials are kept.
        WayfarerError: the cluster was lost, or ``out`` cannot be written any more; finished trials are kept.
    """
    if log:
        make_empty_folder(log, "the log")
    aside = Console(stderr=True)
    notice, content = partial(say, aside), content_of(forests) if forests and out else None
    with (
        _connected(cluster) as workers,
        Results.kept(plan, out, resume=resume, forests=content, command=command, notice=notice) as results,
    ):
        kept, total = len(results.rows), results.total
        if kept:
            say(aside, f"{kept} of {total} trials are in {out} already")
        with shown_progress(aside, kept, total) as progress:
            cost = run(
                results, jobs=workers.jobs if workers else jobs or cores(),
                executor=workers.executor if workers else None, progress=progress, notice=notice, logs=log,
                run_trial=run_trial,
            )  # fmt: skip
    if not results.finished:
        where = f"kept in {out}; continue with --resume" if out else "done; with --out DIR they are kept"
        say(aside, f"interrupted: {len(results.rows)} of {total} trials are {where}")
        return INTERRUPTED
    if as_json:
        print_json(_as_json(results, cost))
        return 0
    console = Console()
    print_whole(console, table_of(results))
    if plan.axes:
        console.print(layouts_note(results), markup=False, highlight=False)
    else:
        per_tick = f", {cost.cpu_us_per_tick:.1f} us of CPU per control tick" if cost.cpu_us_per_tick else ""
        say(console, f"{_simulated_s(results) / 3600:.1f} h simulated; this run took {cost.wall_s:.1f} s{per_tick}")
    if out:
        say(aside, f"the results are in {out}")
        say_next("wayfarer", "report", out)
    elif log:
        say_next("wayfarer", "logs", "list", "--log-dir", log)
    return 0


def _connected(cluster: str | None) -> AbstractContextManager[Cluster | None]:
    """Connect to a Dask scheduler, if its address is given."""
    if cluster is None:
        return nullcontext()
    from wayfarer.experiments import dask_cluster

    return dask_cluster.connected(cluster)


def run_alone(campaign: Campaign, trial: int, log: Path | None, *, as_json: bool = False) -> None:
    """Run one trial, and print its row as in ``trials.csv`` or as JSON.

    With ``log`` the full field log goes there, and the traceback of an error.

    Raises:
        BadInput: the campaign has several algorithms, or ``log`` is not new or empty.
        TrialNotRun: the trial raised an error.
    """
    if len(campaign.algorithms) > 1:
        raise BadInput(f"--trial runs one trial of one algorithm; choose one of {', '.join(campaign.algorithms)}")
    if log:
        make_empty_folder(log, "the log")
    try:
        (done,) = run_tasks(TrialRunner(campaign, log_dir=log), [Task(campaign.algorithms[0], trial)], stop=Event())
    except TaskFailed as failed:
        remedy = "correct that and run it again; with --log-dir DIR its log and the traceback are written there"
        if log:
            with suppress(OSError):  # such as of a disk that is full
                (log / TRACEBACK_FILE).write_text("".join(format_exception(failed.error)), encoding="utf-8")
            remedy = f"correct that; its log and the traceback are in {log}"
        raise not_run(failed, remedy) from failed.error
    results = Results(campaign, [done.row])
    if as_json:
        print_json(results.trials[0])
    else:
        print(csv_line(results.columns) + csv_line(results.columns, done.row), end="")
        if log:
            say_next("wayfarer", "report", log)


def _as_json(results: Results, cost: ComputeCost) -> dict[str, Any]:
    """Return what ``--json`` prints; ``last_run`` is this run, without what was kept before."""
    return {
        "table": [
            ({"point": results.swept[at]} if results.plan.axes else {}) | rounded_values(summarise(name, rows))
            for (at, name), rows in results.cells.items()
        ],
        "simulated_s": round(_simulated_s(results), 3),
        "last_run": rounded_values({**cost._asdict(), "cpu_us_per_tick": cost.cpu_us_per_tick}),
    }


def _simulated_s(results: Results) -> float:
    return sum(row.time_s or 0.0 for row in results.rows)
