from __future__ import annotations

import io

from rich.console import Console
from rich.table import Table

from wayfarer.logview.terminal_table import Column, add_row, table

NAME: Column[tuple[str, float]] = Column("name", lambda row: row[0], left=True)
PATH: Column[tuple[str, float]] = Column("path\nm", lambda row: f"{row[1]:.1f}")
WORDS: Column[tuple[str, float]] = Column("words", lambda row: f"{row[0]} went far and farther", left=True, wraps=True)
ROWS = [("[own]", 7.5), ("pledge", 123.0)]


def lines(made: Table, width: int = 60) -> list[str]:
    console = Console(file=io.StringIO(), width=width)
    console.print(made)
    assert isinstance(console.file, io.StringIO)
    return [line.rstrip() for line in console.file.getvalue().splitlines()]


def test_names_stand_left_figures_right_and_brackets_are_no_markup() -> None:
    made = table([NAME, PATH], ROWS)
    add_row(made, ["[bold]", ""], style="dim")
    assert lines(made) == [
        "          path",
        " name        m",
        "──────────────",
        " [own]     7.5",
        " pledge  123.0",
        " [bold]",
    ]


def test_gap_is_that_between_columns() -> None:
    assert lines(table([NAME, PATH], ROWS, gap=1))[-1] == "pledge 123.0"


def test_only_what_may_be_wrapped_is() -> None:
    narrow = lines(table([NAME, WORDS], ROWS[1:]), width=24)
    assert narrow[2:] == [" pledge  pledge went far", "         and farther"]
