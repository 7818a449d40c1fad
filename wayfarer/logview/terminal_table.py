"""Tables for a terminal: titles over a rule, figures at the right of their columns. Only ``listing`` makes another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

T = TypeVar("T")
UNBOUNDED = 1000  # columns: wider than any table


@dataclass(frozen=True, slots=True)
class Column(Generic[T]):
    """One column: its title, and how it reads for a row.

    Figures stand at the right. With ``left`` words stand at the left, and with ``wraps`` they may be broken into lines.
    """

    title: str
    cell: Callable[[T], str | Text]
    left: bool = False
    wraps: bool = False


class TextTable(NamedTuple):
    """A table of results as texts, for a terminal and a page: titles, rows of a kind and its cells, and notes below.

    The first ``names`` columns say what a row is; a kind other than ``""`` is a row beside ours, such as the paper's.
    """

    titles: Sequence[str]
    rows: Sequence[tuple[str, Sequence[str]]]
    notes: Sequence[str] = ()
    names: int = 1


def table(columns: Sequence[Column[T]], rows: Iterable[T] = (), *, gap: int = 2) -> Table:
    """Return a table with ``gap`` blanks, at least one, between two columns."""
    made = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 0, 0, gap - 1))
    for column in columns:
        made.add_column(Text(column.title), justify="left" if column.left else "right", no_wrap=not column.wraps)
    for row in rows:
        add_row(made, (column.cell(row) for column in columns))
    return made


def add_row(made: Table, cells: Iterable[str | Text], style: str = "") -> None:
    """Add a row to a table. Brackets in a cell are not markup: ``[own]`` is a name, ``[95 %]`` an interval."""
    made.add_row(*(cell if isinstance(cell, Text) else Text(cell) for cell in cells), style=style)


def print_whole(console: Console, whole: TextTable) -> None:
    """Print a table and its notes; no number is ever cut off.

    If the console is too narrow, columns go into tables below each other, each with the names of the rows; if it is too
    narrow for that too, each row becomes a list under its name.
    """
    titles, rows, notes, names = whole
    groups: list[list[int]] = [[]]
    for column in range(names, len(titles)):
        if groups[-1] and not _fitting(console, whole, [*range(names), *groups[-1], column]):
            groups.append([])
        groups[-1].append(column)
    parts = [_fitting(console, whole, [*range(names), *group]) for group in groups]
    for part in parts if all(parts) else ():
        console.print(part)
        console.print()
    for _, cells in () if all(parts) else rows:
        _say(console, ", ".join(cell.strip() for cell in cells[:names]))
        for title, cell in zip(titles[names:], cells[names:], strict=True):
            if cell:
                _say(console, f"  {title.replace(chr(10), ' ')}: {cell}")
        console.print()
    for note in notes:
        _say(console, note)


def _fitting(console: Console, whole: TextTable, columns: Sequence[int]) -> Table | None:
    """Return a table of these columns, closer if it must be; None if the console is too narrow for it."""
    for gap in (2, 1):
        made = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 0, 0, gap - 1))
        for at in columns:
            made.add_column(Text(whole.titles[at]), justify="left" if at == 0 else "right", no_wrap=True)
        for kind, cells in whole.rows:
            if kind and not any(cells[at] for at in columns[whole.names :]):
                continue
            add_row(made, [cells[at] for at in columns], style="dim" if kind else "")
        if console.measure(made, options=console.options.update(max_width=UNBOUNDED)).maximum <= console.width:
            return made
    return None


def _say(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False)
