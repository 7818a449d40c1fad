"""Results of scenarios, of the catalogue or a user's, and how they are printed: as a table that fits the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from enum import StrEnum
from textwrap import wrap
from typing import NamedTuple

from rich.console import Console
from rich.text import Text

from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.tables import number_text
from wayfarer.fault_scenarios.catalogue import FaultTest
from wayfarer.fault_scenarios.scenario import ResponseLevel, Scenario
from wayfarer.views.text.terminal_table import Column, table

Row = Scenario | FaultTest


class Tried(StrEnum):
    """How a fault was tried."""

    SIMULATED = "virtual time"
    TEST = "a test"


class Result(NamedTuple):
    """How one fault was met.

    Times are seconds from the beginning of the fault; None where nothing of that kind can be timed. ``changed`` says
    what the field code read, or was told, that it would not have without the fault. ``problems`` is empty where all was
    as expected; ``remark`` is for the reader: why the level is another than the catalogue's, or what only a real part
    can show and how. Of a row that was not run ``skipped`` says why; it has neither passed nor failed.
    """

    name: str
    row: int | None
    about: str
    tried: Tried
    asked: str
    expected: ResponseLevel
    reached: ResponseLevel = ResponseLevel.NONE
    within_s: float | None = None
    changed: str = ""
    detected_s: float | None = None
    stopped_s: float | None = None
    cause: str = ""
    problems: tuple[str, ...] = ()
    remark: str = ""
    skipped: str = ""

    @property
    def passed(self) -> bool:
        """Whether it was run and all was as expected."""
        return not (self.problems or self.skipped)


def not_run(row: Row, skipped: str = "") -> Result:
    """Return the result of a row that was not run, and why."""
    if isinstance(row, FaultTest):
        tried, level, within_s = Tried.TEST, row.level, row.within_s
    else:
        tried, level, within_s = Tried.SIMULATED, row.expect.level, None
    return Result(row.name, row.row, row.about, tried, row.asked, level, within_s=within_s, skipped=skipped)


REASONS_SHOWN = 4  # without ``verbose``, so that the sum is at most ten lines
LEGEND = (
    "S0 note, S1 degrade, S2 hold, S3 fault until re-armed, S4 the board's deadman",
    "seen: reported; stopped: wheels commanded to stop; seconds since the fault",
)


def _verdict(result: Result) -> Text:
    if result.skipped:
        return Text("skipped", "yellow")
    return Text("ok", "green") if result.passed else Text("FAILED", "bold red")


# With the width of the terminal from which on a column is shown.
COLUMNS: tuple[tuple[int, Column[Result]], ...] = (
    (0, Column("row", lambda each: str(each.row or ""))),
    (0, Column("fault", lambda each: each.name, left=True)),
    (150, Column("what happens", lambda each: each.about, left=True, wraps=True)),
    (105, Column("asked for", lambda each: each.asked, left=True, wraps=True)),
    (0, Column("level\nwanted", lambda each: "" if each.skipped else each.expected.value, left=True)),
    (0, Column("level\ngot", lambda each: "" if each.skipped else each.reached.value, left=True)),
    (130, Column("by", lambda each: each.cause, left=True)),
    (0, Column("seen\nafter", lambda each: number_text(each.detected_s, 2))),
    (0, Column("stopped\nafter", lambda each: number_text(each.stopped_s, 2))),
    (0, Column("bound", lambda each: number_text(each.within_s, 2))),
    (0, Column("verdict", _verdict, left=True)),
    (190, Column("first changed", lambda each: each.changed, left=True, wraps=True)),
)
LISTED: tuple[Column[Row], ...] = (
    Column("row", lambda each: str(each.row or "")),
    Column("name", lambda each: each.name, left=True),
    Column("what happens", lambda each: each.about, left=True, wraps=True),
)


def print_results(
    console: Console, results: Sequence[Result], untried: Sequence[int], *, verbose: bool = False
) -> None:
    """Print what was not as expected, and the sum; with ``verbose`` all of the table, remarks and what was skipped.

    Args:
        console: where to.
        results: in the order of the table.
        untried: rows of the fault catalogue that nothing tries.
        verbose: whether a person asked for all.
    """
    shown = list(results) if verbose else [each for each in results if each.problems]
    if shown:
        console.print(table([column for from_width, column in COLUMNS if from_width <= console.width], shown))
        for line in LEGEND:
            say(console, line)
    section(console, "Not as expected", [f"{each.name}: {problem}" for each in shown for problem in each.problems])
    if verbose:
        section(console, "Remarks", with_names((each.remark, each.name) for each in results))
        section(console, "Skipped", with_names((each.skipped, each.name) for each in results))
    if untried:
        section(console, "Untried", [f"no scenario for row {', '.join(map(str, untried))} of the fault catalogue"])
    if shown or untried:
        console.print()
    for line in summed_up(results, untried):
        say(console, line)
    if not verbose:
        for line in _skipped_in_brief(results):
            say(console, line)
        say(console, "-v prints each scenario, remarks, and what is skipped and why")


def _skipped_in_brief(results: Iterable[Result]) -> Iterator[str]:
    """Say what is skipped, in a few lines."""
    skipped = [each for each in results if each.skipped]
    by_tests = sum(each.tried is Tried.TEST for each in skipped)
    if by_tests:
        yield f"{by_tests} scenario{'s' * (by_tests > 1)} skipped: covered by a test in wayfarer's checkout"
    lines = list(skipped_lines(each for each in skipped if each.tried is not Tried.TEST))
    yield from lines[:REASONS_SHOWN]
    if len(lines) > REASONS_SHOWN:
        yield f"{len(lines) - REASONS_SHOWN} more reasons for which scenarios are skipped"


def skipped_lines(skipped: Iterable[Result]) -> Iterator[str]:
    """Give each reason for which scenarios are skipped once, with how many they are."""
    for why, count in Counter(each.skipped for each in skipped).items():
        yield f"{count} scenario{'s' * (count > 1)} skipped: {why}"


def print_list(console: Console, rows: Sequence[Row]) -> None:
    """Print what there is to run."""
    console.print(table(LISTED, rows))


def summed_up(results: Sequence[Result], untried: Sequence[int] = ()) -> Iterator[str]:
    """Give the last lines: how many scenarios are as expected, and of how many rows all scenarios are."""
    run = [each for each in results if not each.skipped]
    how = f"{len(run)} in virtual time" if run else "none"
    skipped = f"; {len(results) - len(run)} skipped" if len(run) < len(results) else ""
    yield f"{sum(each.passed for each in run)} of {len(run)} scenarios as expected: {how}{skipped}"
    rows = {each.row for each in results if each.row is not None}
    if rows:
        failed = {each.row for each in run if not each.passed}
        in_part = {each.row for each in results if each.skipped and each.row is not None} - failed
        skipped = f"; {len(in_part)} not fully tested" if in_part else ""
        yield f"{len(rows - failed - in_part)} of {len(rows) + len(untried)} rows of the catalogue as expected{skipped}"


def with_names(remarks: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Give remarks, each once, with the names of what it is about."""
    about: dict[str, list[str]] = {}
    for remark, name in remarks:
        if remark:
            about.setdefault(remark, []).append(name)
    for remark, names in about.items():
        yield f"{', '.join(names)}: {remark}"


def section(console: Console, title: str, lines: Iterable[str]) -> None:
    """Print lines under a title, indented and broken at spaces, so that a test's name is whole; nothing without any."""
    lines = list(lines)
    if lines:
        console.print(Text(f"\n{title}", "bold"))
    for line in lines:
        for number, piece in enumerate(
            wrap(line, max(20, console.width - 4), break_long_words=False, break_on_hyphens=False)
        ):
            console.print(Text(f"{'    ' if number else '  '}{piece}"), soft_wrap=True)
