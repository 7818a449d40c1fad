"""Implementation of ``wayfarer sim`` after its options are parsed: a whole campaign, or one trial."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import partial
from pathlib import Path
from threading import Event
from traceback import format_exception
from typing import TYPE_CHECKING

from rich.console import Console

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign, Plan, Task
from wayfarer.experiments.checks import INTERRUPTED, make_empty_folder
from wayfarer.experiments.paper import reported
from wayfarer.experiments.pool import TaskFailed, cores, run_tasks
from wayfarer.experiments.progress_bar import say, shown_progress
from wayfarer.experiments.results_folder import ResultsFolder, count_of
from wayfarer.experiments.rows import columns_of, csv_line
from wayfarer.experiments.run import CampaignRun, RunTrial, TrialRunner, not_run, run
from wayfarer.experiments.tables import campaign_table
from wayfarer.logview.terminal import print_json, say_next
from wayfarer.logview.terminal_table import print_whole
from wayfarer.simhal.world.forest_file import content_of

if TYPE_CHECKING:
    from wayfarer.experiments.dask_cluster import Cluster

TRACEBACK_FILE = "traceback.txt"


def run_all(
    campaign: Campaign,
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
    """Run a campaign, show it, print its table, or with ``as_json`` an object, and return the exit code.

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
    with (
        connected(cluster) as workers,
        kept_in(out, campaign, resume=resume, command=command) if out else nullcontext() as folder,
    ):
        if folder and forests:
            folder.keep_forests(content_of(forests))
        finished = run_shown(
            campaign,
            folder,
            jobs=workers.jobs if workers else jobs or cores(),
            executor=workers.executor if workers else None,
            logs=log,
            run_trial=run_trial,
        )
    if finished.interrupted:
        return INTERRUPTED
    if as_json:
        print_json(finished.as_json())
        return 0
    console = Console()
    by_algorithm = {name: rows for _, name, rows in finished.cells}
    papers = reported(campaign.settings())
    print_whole(console, campaign_table(by_algorithm, papers, site=campaign.site is not None))
    say(console, _effort(finished))
    if out:
        say(Console(stderr=True), f"the results are in {out}")
        say_next("wayfarer", "report", out)
    elif log:
        say_next("wayfarer", "logs", "list", "--log-dir", log)
    return 0


def kept_in(out: Path, plan: Plan, *, resume: bool, command: Sequence[str] | None) -> ResultsFolder:
    """Return the folder that keeps what a command runs."""
    notice = partial(say, Console(stderr=True))
    return ResultsFolder(out, plan.settings(), resume=resume, command=command, notice=notice)


def run_shown(
    plan: Plan,
    folder: ResultsFolder | None,
    *,
    jobs: int,
    executor: Executor | None = None,
    logs: Path | None = None,
    run_trial: RunTrial | None = None,
) -> CampaignRun:
    """Run a campaign or a sweep with its progress on stderr, where an interruption is told too.

    Raises:
        WayfarerError: as of ``run.run``.
    """
    aside, kept, total = Console(stderr=True), len(folder.rows) if folder else 0, count_of(plan.settings())
    if folder and kept:
        say(aside, f"{kept} of {total} trials are in {folder.path} already")
    with shown_progress(aside, kept, total) as progress:
        finished = run(
            plan, folder, jobs=jobs, executor=executor, progress=progress, notice=partial(say, aside), logs=logs,
            run_trial=run_trial,
        )  # fmt: skip
    if finished.interrupted:
        where = f"kept in {folder.path}; continue with --resume" if folder else "done; with --out DIR they are kept"
        say(aside, f"interrupted: {len(finished.rows)} of {total} trials are {where}")
    return finished


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
    columns = columns_of(campaign.settings())
    if as_json:
        cells = done.row.cells()
        print_json({name: cells[name] for name in columns})
    else:
        print(csv_line(columns) + csv_line(columns, done.row), end="")
        if log:
            say_next("wayfarer", "report", log)


def connected(cluster: str | None) -> AbstractContextManager[Cluster | None]:
    """Connect to a Dask scheduler, where its address is given.

    Raises:
        BadInput: no scheduler answers there, it has no workers, or one of them runs another version.
    """
    if cluster is None:
        return nullcontext()
    from wayfarer.experiments import dask_cluster

    return dask_cluster.connected(cluster)


def _effort(finished: CampaignRun) -> str:
    effort = finished.effort
    simulated_h = finished.simulated_s / 3600
    per_tick = f", {effort.cpu_us_per_tick:.1f} us of CPU a control tick" if effort.cpu_us_per_tick else ""
    return f"{simulated_h:.1f} h simulated; this run took {effort.wall_s:.1f} s{per_tick}"
