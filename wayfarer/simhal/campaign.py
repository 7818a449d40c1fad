"""A campaign from its first trial to its last: run, keep, sum up.

One loop does it all: a finished trial is kept in the folder, then shown. SIGINT and SIGTERM only set a flag
that the loop looks at, so that nothing is cut in the middle; a second one ends the process the usual way.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator, Sized
from concurrent.futures import BrokenExecutor, Executor
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from wayfarer.errors import WayfarerError
from wayfarer.simhal.plan import Campaign
from wayfarer.simhal.progress import Progress
from wayfarer.simhal.results import ResultsFolder
from wayfarer.simhal.rows import Row
from wayfarer.simhal.statistics import Summary, summarise
from wayfarer.simhal.workers import RunTrial, Stopped, TrialRunner, field_trial, stream

SAME_SIGNAL_S = 0.5  # a signal to the whole process group may reach the workers first


class Effort(NamedTuple):
    """What a run took: seconds on the clock, CPU seconds of this process and its workers, control ticks."""

    wall_s: float
    cpu_s: float
    ticks: int

    @property
    def cpu_us_per_tick(self) -> float | None:
        """CPU per control tick in microseconds, set-up and overhead included; None where nothing was run."""
        return 1e6 * self.cpu_s / self.ticks if self.ticks else None


@dataclass(frozen=True, slots=True)
class Finished:
    """How a run ended: the rows there are, in the order of ``trials.csv``, and what this run took."""

    campaign: Campaign
    rows: list[Row]
    effort: Effort

    @property
    def interrupted(self) -> bool:
        """Tell whether trials are missing."""
        return len(self.rows) < len(self.campaign.algorithms) * self.campaign.trials

    def summaries(self) -> list[Summary]:
        """Return the table: one line an algorithm, as far as it has trials."""
        by_algorithm: dict[str, list[Row]] = {}
        for row in self.rows:
            by_algorithm.setdefault(row.algorithm, []).append(row)
        return [summarise(algorithm, rows) for algorithm, rows in by_algorithm.items()]

    def as_json(self) -> dict[str, Any]:
        """Return what ``summary.json`` holds; ``last_run`` is this run, without what was kept before."""
        return {
            **self.campaign.settings(),
            "table": [_rounded(asdict(summary)) for summary in self.summaries()],
            "simulated_s": round(sum(row.time_s or 0.0 for row in self.rows), 3),
            "ticks": sum(row.ticks or 0 for row in self.rows),
            "last_run": _rounded({**self.effort._asdict(), "cpu_us_per_tick": self.effort.cpu_us_per_tick}),
        }


def run(
    campaign: Campaign,
    folder: ResultsFolder | None = None,
    *,
    jobs: int = 1,
    progress: Progress | None = None,
    executor: Executor | None = None,
    run_trial: RunTrial = field_trial,
) -> Finished:
    """Run the trials that ``folder`` does not hold yet, and write the final files when none is missing.

    Results depend neither on ``jobs``, the number of processes, nor on an ``executor`` in their place.

    Raises:
        WayfarerError: a worker died, or the folder cannot be written any more; finished trials are kept.
    """
    rows = {row.key: row for row in folder.kept} if folder else {}
    todo = [task for task in campaign.tasks_by_forest() if task not in rows]
    jobs = max(1, min(jobs, len(todo)))
    progress = progress or Progress()
    began, ticks = os.times(), 0
    with stop_on_signals() as stop:
        with (
            suppress(Stopped),
            _worker_death_explained(rows, stop),
            closing(stream(TrialRunner(campaign, run_trial), todo, jobs, stop, executor)) as finished,
        ):
            for done in finished:
                rows[done.row.key] = done.row
                ticks += done.row.ticks or 0
                if folder:
                    folder.append(done.row)
                progress.advance(done)
        ordered = [rows[task] for task in campaign.tasks() if task in rows]
        result = Finished(campaign, ordered, _effort(began, ticks))
        if folder and not result.interrupted and not folder.complete:
            folder.finish(result.rows, result.as_json())
    return result


def _rounded(values: dict[str, Any]) -> dict[str, Any]:
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in values.items()}


def _effort(began: os.times_result, ticks: int) -> Effort:
    """Measure since ``began``; the CPU of workers counts once they have ended."""
    now = os.times()
    return Effort(now.elapsed - began.elapsed, sum(now[:4]) - sum(began[:4]), ticks)


@contextmanager
def stop_on_signals() -> Iterator[threading.Event]:
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
            f"a worker process died after {len(rows)} trials, most likely for want of memory; "
            "what --out keeps is safe: add --resume, with fewer --jobs"
        ) from error
