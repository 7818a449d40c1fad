"""Progress of a campaign or another batch: a bar on a terminal, otherwise a line for each tenth."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from wayfarer.experiments.executors import Done

LINES = 10  # for a whole batch
FAULTS_TOLD = 5  # further ones are counted in the table


class RateColumn(ProgressColumn):
    """Tasks a second."""

    def render(self, task: Task) -> Text:
        """Return the rate over the last half minute."""
        return Text(f"{task.speed:.1f} {task.description}/s" if task.speed else "")


@contextmanager
def shown_count(console: Console, done: int, total: int, what: str) -> Iterator[Callable[[], None]]:
    """Show how many of ``total`` tasks, called ``what`` in plural, are done; give what is to be called at each.

    On a terminal it is a bar with the rate and the time left, elsewhere a line for each tenth of the tasks.
    """
    count, on_terminal = TextColumn("{task.completed} of {task.total} {task.description}"), console.is_terminal
    columns, finished = (BarColumn(), count, RateColumn(), TimeRemainingColumn()), itertools.count(done + 1)
    with Progress(*columns, console=console, transient=True, disable=not on_terminal) as bar:
        shown = bar.add_task(what, total=total, completed=done)

        def advance() -> None:
            bar.advance(shown)
            number = next(finished)
            if not on_terminal and number * LINES // total > (number - 1) * LINES // total:
                say(console, f"{number} of {total} {what}")

        yield advance


@contextmanager
def shown_progress(console: Console, kept: int, total: int) -> Iterator[Callable[[Done], None]]:
    """Show progress from ``kept`` to ``total`` trials and the first few faults; give what is to be told each trial."""
    faults = itertools.count(1)
    with shown_count(console, kept, total, "trials") as advance:

        def take(done: Done) -> None:
            if done.fault and next(faults) <= FAULTS_TOLD:
                say(console, fault_line(done))
            advance()

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
