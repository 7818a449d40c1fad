"""Runs a campaign or a sweep from its first trial to its summary.

One loop does it all: a finished trial is kept in the folder, then shown. SIGINT and SIGTERM only set a flag
that the loop looks at, so that nothing is cut in the middle; a second one ends the process the usual way.
"""

from __future__ import annotations

import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote

from wayfarer.errors import TrialNotRun, WayfarerError, kind_and_text
from wayfarer.experiments.campaign import Plan, Task
from wayfarer.experiments.measures import summarise
from wayfarer.experiments.pool import TaskFailed, run_tasks
from wayfarer.experiments.results_folder import ResultsFolder, count_of, in_table_order, missing, swept_values
from wayfarer.experiments.rows import TrialRow, rounded_values, row_of

if TYPE_CHECKING:
    from wayfarer.experiments.trial import TrialResult
    from wayfarer.experiments.trial_setup import TrialSpec
    from wayfarer.simhal.world.forest import Forest

RunTrial = Callable[["TrialSpec"], "TrialResult"]


class Done(NamedTuple):
    """A finished trial, and how many control ticks it took."""

    row: TrialRow
    ticks: int


class TrialRunner:
    """Runs trials of a campaign or sweep; it can be sent to another process.

    With ``logs`` each trial writes its field log into a separate folder there, such as ``forest-pledge-00017``; with
    ``log_dir`` a single one writes it into that folder.
    ``run_trial`` stands in for the simulator in tests.
    """

    def __init__(
        self, plan: Plan, logs: Path | None = None, run_trial: RunTrial | None = None, *, log_dir: Path | None = None
    ) -> None:
        self._points = plan.points
        self._logs, self._log_dir = logs, log_dir
        self._run_trial = run_trial
        self._latest: tuple[list[int], Forest] | None = None

    def __call__(self, task: Task) -> Done:
        """Run one trial; whatever it raises goes on: it says nothing of the rover."""
        spec = self._points[task.point].spec(task, self._forest(task))
        if self._run_trial:
            result = self._run_trial(spec)
        else:
            from wayfarer.experiments.trial import run_trial  # the simulator is imported only where trials run

            log_dir = self._logs / log_name(task) if self._logs else self._log_dir
            result = run_trial(spec, log_dir)
        return Done(row_of(result)._replace(point=task.point), result.ticks)

    def _forest(self, task: Task) -> Forest:
        """Make a trial's forest, once for all the algorithms that follow each other in it."""
        _, *wanted = task
        latest = self._latest  # another thread of this worker may set it meanwhile
        if latest is None or latest[0] != wanted:
            latest = self._latest = wanted, self._points[task.point].make_forest(task.trial)
        return latest[1]


def log_name(task: Task) -> str:
    """Return the name of the folder of a trial's field log: no other trial of the campaign has it."""
    return f"{quote(task.algorithm, safe='')}-{task.trial:05d}"


def not_run(failed: TaskFailed, remedy: str) -> TrialNotRun:
    """Return the error that says which trial could not be run, and why, in one line that ends with ``remedy``."""
    task, *others = failed.tasks
    which = f"trial {task.trial} of {task.algorithm}" + (f" at point {task.point}" if task.point else "")
    if others:
        which += f", or one of the {len(others)} after it,"
    error = failed.error
    if isinstance(error, WayfarerError | BrokenExecutor):
        what = str(error)
    else:
        what = f"{kind_and_text(error)} ({failed.line})"
    return TrialNotRun(f"{which} could not be run: {what}; {remedy}", getattr(error, "exit_code", 1))


class ComputeCost(NamedTuple):
    """What a run took: seconds on the clock, CPU seconds of this process and its workers, control ticks.

    The CPU of other machines is not known: None.
    """

    wall_s: float
    cpu_s: float | None
    ticks: int

    @property
    def cpu_us_per_tick(self) -> float | None:
        """CPU per control tick in microseconds, set-up and overhead included; None if nothing was run."""
        return 1e6 * self.cpu_s / self.ticks if self.cpu_s is not None and self.ticks else None


@dataclass(frozen=True, slots=True)
class CampaignRun:
    """How a run ended: the ``rows`` that there are, in the table's order once none is missing, and what it took."""

    plan: Plan
    rows: Sequence[TrialRow]
    effort: ComputeCost

    @property
    def interrupted(self) -> bool:
        """Return whether trials are missing."""
        return len(self.rows) < count_of(self.plan.settings())

    @property
    def simulated_s(self) -> float:
        """Simulated time of all trials."""
        return sum(row.time_s or 0.0 for row in self.rows)

    @property
    def cells(self) -> list[tuple[dict[str, Any], str, list[TrialRow]]]:
        """The trials of each algorithm, in a sweep at each point: with the swept values by their keys, and its name."""
        points, cells = swept_values(self.plan.settings()), groupby(self.rows, lambda row: (row.point, row.algorithm))
        return [(points[point], name, list(rows)) for (point, name), rows in cells]

    def as_json(self) -> dict[str, Any]:
        """Return what ``--json`` prints; ``last_run`` is this run, without what was kept before."""
        return {
            **self.plan.settings(),
            "table": [
                ({"point": at} if at else {}) | rounded_values(summarise(name, rows)) for at, name, rows in self.cells
            ],
            "simulated_s": round(self.simulated_s, 3),
            "last_run": rounded_values({**self.effort._asdict(), "cpu_us_per_tick": self.effort.cpu_us_per_tick}),
        }


def run(
    plan: Plan,
    folder: ResultsFolder | None = None,
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Callable[[Done], object] | None = None,
    notice: Callable[[str], object] = warnings.warn,
    logs: Path | None = None,
    run_trial: RunTrial | None = None,
) -> CampaignRun:
    """Run the trials that ``folder`` does not hold yet, and write the final files when none is missing.

    ``progress`` is called with each trial when it is done. Results depend neither on ``jobs``, the number of processes,
    nor on an ``executor`` in their place (``pool.run_tasks``, also for ``notice``); ``logs`` and ``run_trial`` as of
    ``TrialRunner``.

    Raises:
        TrialNotRun: a trial raised an error, or ended its worker; finished trials are kept.
        WayfarerError: the folder cannot be written any more; finished trials are kept.
    """
    settings = plan.settings()
    rows = list(folder.rows) if folder else []
    began, ticks = os.times(), 0
    with _stop_on_signals() as stop:
        runner, tasks = TrialRunner(plan, logs, run_trial), missing(settings, rows)
        try:
            with closing(run_tasks(runner, tasks, jobs=jobs, executor=executor, stop=stop, notice=notice)) as finished:
                for done in finished:
                    if folder:
                        folder.append(done.row)
                    rows.append(done.row)
                    ticks += done.ticks
                    if progress:
                        progress(done)
        except TaskFailed as failed:
            kept = f"{len(rows)} of {count_of(settings)} trials are kept in {folder.path}" if folder else ""
            remedy = f"correct that and continue with --resume: {kept}" if kept else "correct that and run it again"
            raise not_run(failed, remedy) from failed.error
        effort = _effort(began, ticks, elsewhere=executor is not None)
        if len(rows) == count_of(settings):
            rows = in_table_order(rows, settings)
            if folder and not folder.finished:
                folder.finish(rows)
    return CampaignRun(plan, rows, effort)


def _effort(began: os.times_result, ticks: int, *, elsewhere: bool) -> ComputeCost:
    """Measure since ``began``; the CPU of workers counts once they have ended, and not where they are elsewhere."""
    now = os.times()
    return ComputeCost(now.elapsed - began.elapsed, None if elsewhere else sum(now[:4]) - sum(began[:4]), ticks)


@contextmanager
def _stop_on_signals() -> Iterator[threading.Event]:
    """Turn the first SIGINT or SIGTERM into a set event; only a main thread gets signals."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def ask(_number: int, _frame: object) -> None:
        stop.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
