"""Runs a campaign from its first trial to its summary.

One loop does it all: a finished trial is kept in the folder, then shown. SIGINT and SIGTERM only set a flag
that the loop looks at, so that nothing is cut in the middle; a second one ends the process the usual way.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence, Sized
from concurrent.futures import BrokenExecutor
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any, NamedTuple

from wayfarer.errors import WayfarerError
from wayfarer.experiments.campaign import Plan
from wayfarer.experiments.executors import Done, MakeExecutor, RunTrial, Stopped, TrialRunner, field_trial, stream
from wayfarer.experiments.results_folder import ResultsFolder, count_of, in_table_order, missing, swept_values
from wayfarer.experiments.rows import TrialRow, rounded_values
from wayfarer.experiments.statistics import AlgorithmSummary, summarise

SAME_SIGNAL_S = 0.5  # a signal to the whole process group may reach the workers first


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
    """How a run ended: the ``rows`` there are, what this run took, and what they say once none is missing.

    ``summaries`` has one line an algorithm, and in a sweep one at each point: the points one after the other. There are
    none while trials are missing.
    """

    plan: Plan
    rows: Sequence[TrialRow]
    effort: ComputeCost
    summaries: Sequence[AlgorithmSummary] = ()

    @property
    def interrupted(self) -> bool:
        """Return whether trials are missing."""
        return not self.summaries

    @property
    def simulated_s(self) -> float:
        """Simulated time of all trials."""
        return sum(row.time_s or 0.0 for row in self.rows)

    @property
    def points(self) -> list[dict[str, Any]]:
        """The swept values of each summary, by their keys; none in a campaign."""
        return [point for point in swept_values(self.plan.settings()) for _ in self.plan.points[0].algorithms]

    def as_json(self) -> dict[str, Any]:
        """Return what ``--json`` prints; ``last_run`` is this run, without what was kept before."""
        lines = zip(self.points, self.summaries, strict=True)
        return {
            **self.plan.settings(),
            "table": [({"point": at} if at else {}) | rounded_values(asdict(summary)) for at, summary in lines],
            "simulated_s": round(self.simulated_s, 3),
            "last_run": rounded_values({**self.effort._asdict(), "cpu_us_per_tick": self.effort.cpu_us_per_tick}),
        }


def run(
    plan: Plan,
    folder: ResultsFolder | None = None,
    *,
    jobs: int = 1,
    progress: Callable[[Done], object] | None = None,
    executor: MakeExecutor | None = None,
    run_trial: RunTrial = field_trial,
) -> CampaignRun:
    """Run the trials that ``folder`` does not hold yet, and write the final files when none is missing.

    ``progress`` is told each trial when it is done. Results depend neither on ``jobs``, the number of processes, nor on
    an ``executor`` in their place.

    Raises:
        WayfarerError: a worker died, or the folder cannot be written any more; finished trials are kept.
    """
    settings = plan.settings()
    rows = list(folder.rows) if folder else []
    began, ticks = os.times(), 0
    with _stop_on_signals() as stop:
        finished = stream(TrialRunner(plan, run_trial).run, missing(settings, rows), jobs, stop, executor)
        with suppress(Stopped), _worker_death_explained(rows, stop), closing(finished):
            for done in finished:
                if folder:
                    folder.append(done.row)
                rows.append(done.row)
                ticks += done.ticks
                if progress:
                    progress(done)
        effort = _effort(began, ticks, elsewhere=executor is not None)
        if len(rows) < count_of(settings):
            return CampaignRun(plan, rows, effort)
        rows = in_table_order(rows, settings)
        cells = groupby(rows, lambda row: (row.point, row.algorithm))
        ended = CampaignRun(plan, rows, effort, [summarise(name, its_rows) for (_, name), its_rows in cells])
        if folder and not folder.finished:
            folder.finish(rows)
    return ended


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


@contextmanager
def _worker_death_explained(rows: Sized, stop: threading.Event) -> Iterator[None]:
    try:
        yield
    except BrokenExecutor as error:
        if stop.wait(SAME_SIGNAL_S):
            return  # what ended the workers, such as a shutdown, asks this process too
        raise WayfarerError(
            f"a worker process died after {len(rows)} trials, most likely for lack of memory; "
            "the results in --out are kept: continue with --resume and fewer --jobs"
        ) from error
