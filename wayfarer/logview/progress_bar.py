"""Progress of a campaign: a bar on a terminal, otherwise a line for each tenth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

LINES = 10  # for all trials


@contextmanager
def shown_progress(console: Console, kept: int, total: int) -> Iterator[Callable[[object], None]]:
    """Show progress from ``kept`` trials to all; give what is to be called when a trial is done."""
    columns = BarColumn(), MofNCompleteColumn(), TextColumn("trials"), TimeRemainingColumn()
    on_terminal, finished = console.is_terminal, count(kept + 1)
    with Progress(*columns, console=console, transient=True, disable=not on_terminal) as bar:
        shown = bar.add_task("", total=total, completed=kept)

        def advance(_done: object) -> None:
            bar.advance(shown)
            number = next(finished)
            if not on_terminal and number * LINES // total > (number - 1) * LINES // total:
                say(console, f"{number} of {total} trials")

        yield advance


def say(console: Console, text: str) -> None:
    """Print a line as it is: no markup, no colour, no wrapping."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)
