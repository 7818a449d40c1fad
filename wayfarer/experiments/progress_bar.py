"""Progress of a campaign: a bar on a terminal, otherwise a line now and then."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress
from rich.text import Text

from wayfarer.experiments.executors import Done

LINES = 10  # for a whole campaign
FAULTS_TOLD = 5  # further ones are counted in the table


class ProgressDisplay:
    """Shows nothing; the others show more."""

    def advance(self, done: Done) -> None:
        """Take note of a finished trial."""


class ProgressLines(ProgressDisplay):
    """A line for each tenth of the trials, and one for each of the first few faults."""

    def __init__(self, console: Console, kept: int, total: int) -> None:
        self._console = console
        self._finished = kept
        self._total = total
        self._faults_told = 0

    def advance(self, done: Done) -> None:
        """Say what there is to say about a finished trial."""
        self._finished += 1
        if done.fault and self._faults_told < FAULTS_TOLD:
            self._faults_told += 1
            say(self._console, fault_line(done))
        self._show()

    def _show(self) -> None:
        tenths = self._finished * LINES // self._total
        if tenths > (self._finished - 1) * LINES // self._total:
            say(self._console, f"{self._finished} of {self._total} trials")


class ProgressBar(ProgressLines):
    """A bar with the rate and the time left, below the lines about faults."""

    def __init__(self, bar: RichProgress, kept: int, total: int) -> None:
        super().__init__(bar.console, kept, total)
        self._bar = bar
        self._task = bar.add_task("trials", total=total, completed=kept)

    def _show(self) -> None:
        self._bar.advance(self._task)


class TrialRateColumn(ProgressColumn):
    """Trials a second."""

    def render(self, task: Task) -> Text:
        """Return the rate over the last half minute."""
        return Text(f"{task.speed:.1f} trials/s" if task.speed else "")


@contextmanager
def shown_progress(console: Console, kept: int, total: int) -> Iterator[ProgressDisplay]:
    """Show progress on ``console`` from ``kept`` to ``total`` trials."""
    if not console.is_terminal:
        yield ProgressLines(console, kept, total)
        return
    count = TextColumn("{task.completed} of {task.total} trials")
    with RichProgress(
        BarColumn(), count, TrialRateColumn(), TimeRemainingColumn(), console=console, transient=True
    ) as bar:
        yield ProgressBar(bar, kept, total)


@contextmanager
def drawing(console: Console) -> Iterator[Callable[[float], None]]:
    """Show on a terminal which share of a film's pictures is drawn; give what is to be told it."""
    left = TimeRemainingColumn()
    with RichProgress(
        BarColumn(), "pictures", left, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
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
