"""Progress output and worker-crash messages for batch runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sized
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import track

from wayfarer.errors import WayfarerError
from wayfarer.experiments.progress_bar import LINES, say

T = TypeVar("T")


def shown(done: Iterable[T], total: int, what: str, console: Console) -> Iterator[T]:
    """Yield what is done beside a bar on a terminal, or with a line for each tenth elsewhere."""
    if console.is_terminal:
        yield from track(done, what, total, console=console, transient=True)
        return
    for number, each in enumerate(done, 1):
        yield each
        if total >= LINES and number * LINES // total > (number - 1) * LINES // total:
            say(console, f"{number} of {total} {what}")


@contextmanager
def worker_death_explained(done: Sized, what: str) -> Iterator[None]:
    """Say after how many of ``what`` a worker died.

    Raises:
        WayfarerError: one did.
    """
    try:
        yield
    except BrokenExecutor as error:
        text = f"a worker process died after {len(done)} {what}, most likely for want of memory: try fewer --jobs"
        raise WayfarerError(text) from error
