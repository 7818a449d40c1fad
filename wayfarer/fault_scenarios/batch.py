"""Runs a batch of scenarios or trials on the cores of this computer, and shows how far it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing

from rich.console import Console

from wayfarer.errors import WayfarerError
from wayfarer.experiments.commands import cores
from wayfarer.experiments.executors import DoneT, TaskT, stream
from wayfarer.experiments.progress_bar import shown_count
from wayfarer.experiments.run_campaign import stop_on_signals


def run_batch(run: Callable[[TaskT], DoneT], tasks: Sequence[TaskT], jobs: int | None, what: str) -> Iterator[DoneT]:
    """Yield what ``run`` returns for each task, in the order of completion; progress is shown on stderr.

    Args:
        run: is sent to the worker processes.
        tasks: what to run.
        jobs: the number of processes, None for one a core.
        what: what the tasks are called, in plural.

    Raises:
        Stopped: a signal asked for it.
        WayfarerError: a worker died.
    """
    done = 0
    try:
        with (
            stop_on_signals() as stop,
            closing(stream(run, tasks, jobs or cores(), stop)) as running,
            shown_count(Console(stderr=True), 0, len(tasks), what) as advance,
        ):
            for result in running:
                yield result
                done += 1
                advance()
    except BrokenExecutor as error:
        text = f"a worker process died after {done} {what}, most likely for lack of memory: try fewer --jobs"
        raise WayfarerError(text) from error
