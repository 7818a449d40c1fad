"""Which scenarios to run, as asked for on a command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from wayfarer.config import load_rover
from wayfarer.errors import BadInput, UnknownName
from wayfarer.simhal.scenarios.result import Procedure
from wayfarer.simhal.scenarios.rovers import misfit, rover_of
from wayfarer.simhal.scenarios.scenario import Scenario

Row = Scenario | Procedure


class LeftOut(NamedTuple):
    """What cannot be run on the rover that was asked for, and why."""

    name: str
    why: str


def chosen(rows: Sequence[Row], asked: str) -> list[Row]:
    """Return what a comma-separated list of names and row numbers asks for, in the order of ``rows``.

    Raises:
        BadInput: there is no such row.
        UnknownName: no such scenario; the text offers the nearest names.
    """
    wanted: list[Row] = []
    for item in filter(None, map(str.strip, asked.split(","))):
        found = [row for row in rows if item in {row.name, str(row.row)}]
        if not found and item.isdecimal():
            raise BadInput(f"nothing tries row {item}; --list shows the rows that there are")
        if not found:
            raise UnknownName("scenario", item, {row.name for row in rows})
        wanted += found
    if not wanted:
        raise BadInput("--only is empty; give names or rows, such as --only compass-nack,37")
    return [row for row in rows if row in wanted]


def on_another_rover(rows: Sequence[Row], rover: str) -> tuple[list[Row], list[LeftOut]]:
    """Return the rows for another rover, and those that it cannot have.

    Raises:
        UnknownName: no shipped rover of that name.
        BadInput: its file is not right.
    """
    load_rover(rover)
    fitting: list[Row] = []
    left_out: list[LeftOut] = []
    for row in rows:
        why, moved = _moved(row, rover)
        if why:
            left_out.append(LeftOut(row.name, why))
        else:
            fitting.append(moved)
    return fitting, left_out


def _moved(row: Row, rover: str) -> tuple[str, Row]:
    """Return why a row cannot be run on another rover (nothing where it can), and the row for it."""
    if isinstance(row, Procedure):
        return "it has rovers of its own", row
    moved = replace(row, rover=rover)
    try:
        config = rover_of(moved)
        return next(filter(None, (misfit(config, moved.depth, fault) for fault in moved.faults)), ""), moved
    except BadInput as error:
        return str(error), moved
