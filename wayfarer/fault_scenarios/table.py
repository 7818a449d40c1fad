"""Prints the results of scenarios as a table that fits the terminal, then the details of failures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from wayfarer.experiments.progress_bar import say
from wayfarer.fault_scenarios.result import Result, Tried
from wayfarer.fault_scenarios.scenario import Reached
from wayfarer.fault_scenarios.selection import Row

LEGEND = (
    "S0 note, S1 degrade, S2 hold, S3 fault until re-armed, S4 the board's deadman",
    "seen: reported; stopped: wheels commanded to stop; seconds since the fault",
)
_HOW = {
    Tried.SIMULATED: "in virtual time",
    Tried.DAEMON: "on the real daemon",
    Tried.COMMAND: "by a real command",
}


@dataclass(frozen=True, slots=True)
class ResultColumn:
    """One column; shown on terminals of at least ``from_width`` columns. One that is ``text`` may be wrapped."""

    title: str
    cell: Callable[[Result], str | Text]
    from_width: int = 0
    text: bool = False
    right: bool = False


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _level(result: Result, level: Reached) -> str:
    return "" if result.skipped else level.value


def _verdict(result: Result) -> Text:
    if result.skipped:
        return Text("skipped", "yellow")
    return Text("ok", "green") if result.passed else Text("FAILED", "bold red")


COLUMNS = (
    ResultColumn("row", lambda each: "" if each.row is None else str(each.row), right=True),
    ResultColumn("fault", lambda each: each.name),
    ResultColumn("what happens", lambda each: each.about, from_width=150, text=True),
    ResultColumn("asked for", lambda each: each.asked, from_width=105, text=True),
    ResultColumn("level\nwanted", lambda each: _level(each, each.expected)),
    ResultColumn("level\ngot", lambda each: _level(each, each.reached)),
    ResultColumn("by", lambda each: each.cause, from_width=130),
    ResultColumn("seen\nafter", lambda each: _seconds(each.detected_s), right=True),
    ResultColumn("stopped\nafter", lambda each: _seconds(each.stopped_s), right=True),
    ResultColumn("bound", lambda each: _seconds(each.within_s), right=True),
    ResultColumn("verdict", _verdict),
    ResultColumn("first changed", lambda each: each.changed, from_width=190, text=True),
)


def print_results(console: Console, results: Sequence[Result], untried: Sequence[int]) -> None:
    """Print the table, what was not as expected, remarks, what was skipped, and the sum.

    Args:
        console: where to.
        results: in the order of the table.
        untried: rows of the field catalogue that nothing tries.
    """
    console.print(_table(console.width, results))
    for line in LEGEND:
        say(console, line)
    _section(console, "Not as expected", _problems(results))
    _section(console, "Remarks", _told_once((each.remark, each.name) for each in results))
    _section(console, "Skipped", _told_once((each.skipped, each.name) for each in results))
    if untried:
        _section(console, "Untried", [f"no scenario for row {', '.join(map(str, untried))} of the field catalogue"])
    console.print()
    for line in summed_up(results, untried):
        say(console, line)


def skipped_lines(skipped: Iterable[Result]) -> Iterator[str]:
    """Give each reason for which scenarios are skipped once, with how many they are."""
    for why, count in Counter(each.skipped for each in skipped).items():
        yield f"{count} scenario{'s' * (count > 1)} skipped: {why}"


def print_list(console: Console, rows: Sequence[Row]) -> None:
    """Print what there is to run."""
    table = Table("row", "name", "what happens", box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    table.columns[0].justify, table.columns[1].no_wrap = "right", True
    for row in rows:
        table.add_row(Text("" if row.row is None else str(row.row)), Text(row.name), Text(row.about))
    console.print(table)


def summed_up(results: Sequence[Result], untried: Sequence[int] = ()) -> Iterator[str]:
    """Give the last lines: how many scenarios are as expected, and of how many rows all scenarios are."""
    run = [each for each in results if not each.skipped]
    ways = Counter(each.tried for each in run)
    how = ", ".join(f"{count} {_HOW[way]}" for way, count in ways.items())
    skipped = f"; {len(results) - len(run)} skipped" if len(run) < len(results) else ""
    yield f"{sum(each.passed for each in run)} of {len(run)} scenarios as expected: {how or 'none'}{skipped}"
    rows = {each.row for each in results if each.row is not None}
    if rows:
        failed = {each.row for each in run if not each.passed}
        in_part = {each.row for each in results if each.skipped and each.row is not None} - failed
        skipped = f"; {len(in_part)} not wholly tried" if in_part else ""
        yield f"{len(rows - failed - in_part)} of {len(rows) + len(untried)} rows of the catalogue as expected{skipped}"


def _table(width: int, results: Iterable[Result]) -> Table:
    columns = [column for column in COLUMNS if column.from_width <= width]
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 1, 0, 0))
    for column in columns:
        table.add_column(column.title, justify="right" if column.right else "left", no_wrap=not column.text)
    for each in results:
        cells = (column.cell(each) for column in columns)
        table.add_row(*(cell if isinstance(cell, Text) else Text(cell) for cell in cells))
    return table


def _problems(results: Iterable[Result]) -> Iterator[str]:
    for each in results:
        for problem in each.problems:
            yield f"{each.name}: {problem}"


def _told_once(remarks: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Give remarks, each once, with the names of what it is about."""
    about: dict[str, list[str]] = {}
    for remark, name in remarks:
        if remark:
            about.setdefault(remark, []).append(name)
    for remark, names in about.items():
        yield f"{', '.join(names)}: {remark}"


def _section(console: Console, title: str, lines: Iterable[str]) -> None:
    """Print lines under a title, each broken at words and indented; nothing without any."""
    lines = list(lines)
    if lines:
        console.print(Text(f"\n{title}", "bold"))
    for line in lines:
        for number, piece in enumerate(Text(line).wrap(console, max(20, console.width - 4))):
            console.print(Text(f"{'    ' if number else '  '}{piece.plain.rstrip()}"), soft_wrap=True)
