"""Progress of a campaign: a bar on a terminal, otherwise a line now and then."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from wayfarer.experiments.executors import Done

LINES = 10  # for a whole campaign
FAULTS_TOLD = 5  # further ones are counted in the table


class TrialRateColumn(ProgressColumn):
    """Trials a second."""

    def render(self, task: Task) -> Text:
        """Return the rate over the last half minute."""
        return Text(f"{task.speed:.1f} trials/s" if task.speed else "")


@contextmanager
def shown_progress(console: Console, kept: int, total: int) -> Iterator[Callable[[Done], None]]:
    """Show progress from ``kept`` to ``total`` trials and the first few faults; give what is to be told each trial.

    On a terminal it is a bar with the rate and the time left, elsewhere a line for each tenth of the trials.
    """
    count, on_terminal = TextColumn("{task.completed} of {task.total} trials"), console.is_terminal
    columns = BarColumn(), count, TrialRateColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True, disable=not on_terminal) as bar:
        task, faults = bar.add_task("trials", total=total, completed=kept), itertools.count(1)

        def advance(done: Done) -> None:
            bar.advance(task)
            if done.fault and next(faults) <= FAULTS_TOLD:
                say(console, fault_line(done))
            finished = int(bar.tasks[0].completed)
            if not on_terminal and finished * LINES // total > (finished - 1) * LINES // total:
                say(console, f"{finished} of {total} trials")

        yield advance


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
