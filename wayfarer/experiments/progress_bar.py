"""Progress of a campaign or another batch: a bar on a terminal, otherwise a line for each tenth."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import timedelta
from math import ceil
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from wayfarer.experiments.executors import Done
from wayfarer.experiments.time_left import TimeLeft

LINES = 10  # for a whole batch
FAULTS_TOLD = 5  # further ones are counted in the table


class RateColumn(ProgressColumn):
    """Tasks a second."""

    def render(self, task: Task) -> Text:
        """Return the rate over the last half minute."""
        return Text(f"{task.speed:.1f} {task.description}/s" if task.speed else "")


class TimeLeftColumn(TimeRemainingColumn):
    """Time until ``ends_at_s`` on the bar's clock; where a task has none, by its rate over the last half minute."""

    def render(self, task: Task) -> Text:
        """Return hours, minutes and seconds."""
        if (ends_at_s := task.fields.get("ends_at_s")) is None:
            return super().render(task)
        left = timedelta(seconds=max(0, ceil(ends_at_s - task.get_time())))
        return Text(str(left), style="progress.remaining")


class Advance(Protocol):
    """To be called at each task that is done, with an estimate of the seconds until the last one where there is one."""

    def __call__(self, left_s: float | None = None, /) -> None:
        """Show one more task."""


@contextmanager
def shown_count(console: Console, done: int, total: int, what: str) -> Iterator[Advance]:
    """Show how many of ``total`` tasks, called ``what`` in plural, are done; give what is to be called at each.

    On a terminal it is a bar with the rate and the time left, elsewhere a line for each tenth of the tasks.
    """
    count, on_terminal = TextColumn("{task.completed} of {task.total} {task.description}"), console.is_terminal
    columns, finished = (BarColumn(), count, RateColumn(), TimeLeftColumn()), itertools.count(done + 1)
    with Progress(*columns, console=console, transient=True, disable=not on_terminal) as bar:
        shown = bar.add_task(what, total=total, completed=done)

        def advance(left_s: float | None = None, /) -> None:
            bar.update(shown, advance=1, ends_at_s=None if left_s is None else bar.get_time() + left_s)
            number = next(finished)
            if not on_terminal and number * LINES // total > (number - 1) * LINES // total:
                say(console, f"{number} of {total} {what}")

        yield advance


@contextmanager
def shown_progress(
    console: Console, kept: int, missing: Mapping[str, int], jobs: int
) -> Iterator[Callable[[Done], None]]:
    """Show progress from ``kept`` trials to all, and the first few faults; give what is to be told each trial.

    ``missing`` are the numbers of trials to be run by algorithm, ``jobs`` of them at a time.
    """
    faults, time_left = itertools.count(1), TimeLeft(missing, jobs)
    with shown_count(console, kept, kept + sum(missing.values()), "trials") as advance:

        def take(done: Done) -> None:
            if done.fault and next(faults) <= FAULTS_TOLD:
                say(console, fault_line(done))
            time_left.take(done.row.algorithm, done.took_s)
            advance(time_left.left_s)

        yield take


@contextmanager
def drawing(console: Console) -> Iterator[Callable[[float], None]]:
    """Show on a terminal which share of a film's pictures is drawn; give what is to be told it."""
    left = TimeRemainingColumn()
    columns, hidden = (BarColumn(), "pictures", left), not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task("pictures", total=1.0)
        yield lambda share: bar.update(task, completed=share)


def fault_line(done: Done) -> str:
    """Say in one line which trial ended in a fault, why, and how to look into it."""
    row, fault = done.row, done.fault
    return (
        f"trial {row.trial} of {row.algorithm} ended in a fault: {fault.text if fault else 'unknown'}; "
        f"look into it with --algorithm {row.algorithm} --trial {row.trial} --log DIR"
    )


def say(console: Console, text: str) -> None:
    """Print a line as it is: no markup, no colour, no wrapping."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)
