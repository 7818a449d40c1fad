"""Runs a campaign or a sweep: the trials of it that have no row yet.

One loop does it all: a finished trial is kept in the folder, then shown. SIGINT and SIGTERM only set a flag
that the loop looks at, so that nothing is cut in the middle; a second one ends the process the usual way.
"""

from __future__ import annotations

import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import quote

from wayfarer.errors import MissingPart, TrialNotRun
from wayfarer.experiments.campaign import Plan, Task
from wayfarer.experiments.pool import TaskFailed, run_tasks
from wayfarer.experiments.results import Results
from wayfarer.experiments.rows import TrialRow, row_of

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
        """Run one trial; any error that it raises is passed on, because it says nothing of the rover."""
        spec = self._points[task.point].spec(task, self._forest(task))
        if self._run_trial:
            result = self._run_trial(spec)
        else:
            from wayfarer.experiments.trial import run_trial  # the simulator is imported only if trials run

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
    # Of a part that is missing the text has said already what to do.
    told = isinstance(failed.error, MissingPart) and remedy.startswith("correct that and run it again")
    why = failed.why if told else f"{failed.why}; {remedy}"
    return TrialNotRun(f"{which} could not be run: {why}", getattr(failed.error, "exit_code", 1))


class ComputeCost(NamedTuple):
    """What a run took: how many trials it ran, seconds on the clock, CPU seconds of all processes, control ticks.

    Trials that an earlier run had finished do not count. The CPU of other machines is not known: None.
    """

    trials: int
    wall_s: float
    cpu_s: float | None
    ticks: int

    @property
    def cpu_us_per_tick(self) -> float | None:
        """CPU per control tick in microseconds, set-up and overhead included; None if nothing was run."""
        return 1e6 * self.cpu_s / self.ticks if self.cpu_s is not None and self.ticks else None


def run(
    results: Results,
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Callable[[Done], object] | None = None,
    notice: Callable[[str], object] = warnings.warn,
    logs: Path | None = None,
    run_trial: RunTrial | None = None,
) -> ComputeCost:
    """Run the trials that are missing in ``results``, put all in order when none is, and say what that took.

    After SIGINT or SIGTERM trials are still missing. ``progress`` is called with each trial when it is done. Results
    depend neither on ``jobs``, the number of processes, nor on an ``executor`` in their place (``pool.run_tasks``, also
    for ``notice``); ``logs`` and ``run_trial`` as of ``TrialRunner``.

    Raises:
        TrialNotRun: a trial raised an error, or ended its worker; finished trials are kept.
        WayfarerError: the folder cannot be written any more; finished trials are kept.
    """
    began, kept, ticks = os.times(), len(results.rows), 0
    runner, tasks = TrialRunner(results.plan, logs, run_trial), results.missing()
    with _stop_on_signals() as stop:
        try:
            with closing(run_tasks(runner, tasks, jobs=jobs, executor=executor, stop=stop, notice=notice)) as finished:
                for done in finished:
                    results.add(done.row)
                    ticks += done.ticks
                    if progress:
                        progress(done)
        except TaskFailed as failed:
            if results.folder is None:
                raise not_run(failed, "correct that and run it again") from failed.error
            rest = f"{len(results.rows)} of {results.total} trials are kept in {results.folder}"
            raise not_run(failed, f"correct that and continue with --resume: {rest}") from failed.error
        if results.finished:
            results.finish()
    now = os.times()  # the CPU of workers counts once they have ended, and not if they are elsewhere
    cpu_s = None if executor is not None else sum(now[:4]) - sum(began[:4])
    return ComputeCost(len(results.rows) - kept, now.elapsed - began.elapsed, cpu_s, ticks)


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
