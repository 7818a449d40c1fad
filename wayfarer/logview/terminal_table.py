"""Tables for a terminal: titles over a rule, figures at the right of their columns. Only ``listing`` makes another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

T = TypeVar("T")
ColumnT = TypeVar("ColumnT", bound="Column[Any]")
UNBOUNDED = 1000  # columns: wider than any table


@dataclass(frozen=True, slots=True)
class Column(Generic[T]):
    """One column: its title, and how it reads for a row.

    Figures stand at the right. With ``left`` words stand at the left, and with ``wraps`` they may be broken into lines.
    With ``if_known`` a table in which no row has a value has no such column (``known``).
    """

    title: str
    cell: Callable[[T], str | Text]
    left: bool = False
    wraps: bool = False
    if_known: bool = False


def known(columns: Iterable[ColumnT], rows: Sequence[Any]) -> tuple[ColumnT, ...]:
    """Return the columns that a table of these rows has."""
    return tuple(each for each in columns if not each.if_known or any(each.cell(row) for row in rows))


def table(columns: Sequence[Column[T]], rows: Iterable[T] = (), *, gap: int = 2) -> Table:
    """Return a table with ``gap`` blanks, at least one, between two columns."""
    made = Table(box=box.SIMPLE_HEAD, show_edge=False, padding=(0, 0, 0, gap - 1))
    for column in columns:
        made.add_column(Text(column.title), justify="left" if column.left else "right", no_wrap=not column.wraps)
    for row in rows:
        add_row(made, (column.cell(row) for column in columns))
    return made


def add_row(made: Table, cells: Iterable[str | Text], style: str = "") -> None:
    """Add a row to a table. Brackets in a cell are no markup: ``[own]`` is a name, ``[95 %]`` an interval."""
    made.add_row(*(cell if isinstance(cell, Text) else Text(cell) for cell in cells), style=style)


def print_in_full(console: Console, whole: Table, parts: Sequence[Table]) -> None:
    """Print a table, or where the console is too narrow for it its parts below each other, closer if they must be."""
    for each in [whole] if _fits(console, whole) else parts:
        if not _fits(console, each):
            each.padding = 0  # leaves one blank between two columns
        console.print(each)
        console.print()


def _fits(console: Console, made: Table) -> bool:
    return console.measure(made, options=console.options.update(max_width=UNBOUNDED)).maximum <= console.width
