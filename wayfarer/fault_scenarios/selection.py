"""Selects the scenarios that a command line asks for, and names those that cannot run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput, UnknownName
from wayfarer.fault_scenarios.result import Procedure, Result, Tried
from wayfarer.fault_scenarios.scenario import Reached, Scenario
from wayfarer.fault_scenarios.scenario_rover import misfit, rover_of
from wayfarer.simhal.build_rover import missing_package

Row = Scenario | Procedure


def unplayed(row: Row) -> Result:
    """Return the result of a row that was not run: nothing came of it."""
    nothing = (Reached.NONE, None, "", None, None, "", ())
    if isinstance(row, Procedure):
        return Result(row.name, row.row, row.about, Tried.DAEMON, "", Reached.NONE, *nothing)
    return Result(row.name, row.row, row.about, Tried.SIMULATED, row.asked, row.expect.level, *nothing)


def without_missing_packages(rows: Sequence[Row]) -> tuple[list[Row], list[Result]]:
    """Return the rows that can be run with the packages that are installed, and the others as skipped."""
    return _sorted_out((_missing_package(row), row) for row in rows)


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


def on_another_rover(rows: Sequence[Row], rover: str) -> tuple[list[Row], list[Result]]:
    """Return the rows for another rover, and those that it cannot have as skipped.

    Raises:
        UnknownName: no shipped rover of that name.
        BadInput: its file is not right.
    """
    load_rover(rover)
    return _sorted_out(_moved(row, rover) for row in rows)


def _sorted_out(rows: Iterable[tuple[str | None, Row]]) -> tuple[list[Row], list[Result]]:
    """Return the rows that nothing keeps from running, and the others with what does."""
    fitting: list[Row] = []
    skipped: list[Result] = []
    for why, row in rows:
        if why:
            skipped.append(unplayed(row)._replace(skipped=why))
        else:
            fitting.append(row)
    return fitting, skipped


def _missing_package(row: Row) -> str | None:
    """Return which package a row needs that is not installed; the processes of a procedure need none."""
    return missing_package(rover_of(row), row.depth) if isinstance(row, Scenario) else None


def _moved(row: Row, rover: str) -> tuple[str, Row]:
    """Return why a row cannot be run on another rover (nothing where it can), and the row for it."""
    if isinstance(row, Procedure):
        return "it names its own rovers", row
    moved = replace(row, rover=rover)
    try:
        config = rover_of(moved)
        return next(filter(None, (misfit(config, moved.depth, fault) for fault in moved.faults)), ""), moved
    except BadInput as error:
        return str(error), moved
