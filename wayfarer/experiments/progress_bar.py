"""Progress of a campaign: a bar on a terminal, otherwise a line for each tenth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from wayfarer.experiments.executors import Done

LINES = 10  # for all trials
FAULTS_SHOWN = 5  # further ones are counted in the table


@contextmanager
def shown_progress(console: Console, kept: int, total: int) -> Iterator[Callable[[Done], None]]:
    """Show progress from ``kept`` trials to all, and the first few faults; give what is to be told each trial."""
    columns = BarColumn(), MofNCompleteColumn(), TextColumn("trials"), TimeRemainingColumn()
    on_terminal, finished, faults = console.is_terminal, count(kept + 1), count(1)
    with Progress(*columns, console=console, transient=True, disable=not on_terminal) as bar:
        shown = bar.add_task("", total=total, completed=kept)

        def take(done: Done) -> None:
            if done.fault and next(faults) <= FAULTS_SHOWN:
                say(console, fault_line(done))
            bar.advance(shown)
            number = next(finished)
            if not on_terminal and number * LINES // total > (number - 1) * LINES // total:
                say(console, f"{number} of {total} trials")

        yield take


def fault_line(done: Done) -> str:
    """Say in one line which trial ended in a fault, why, and how to look into it."""
    row, fault = done.row, done.fault
    return (
        f"trial {row.trial} of {row.algorithm} ended in a fault: {fault.text if fault else 'unknown'}; "
        f"look into it with --algorithm {row.algorithm} --trial {row.trial} --log-dir DIR "
        "in place of --trials and --out"
    )


def say(console: Console, text: str) -> None:
    """Print a line as it is: no markup, no colour, no wrapping."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)
