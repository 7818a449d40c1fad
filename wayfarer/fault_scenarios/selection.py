"""Selects the scenarios that a command line asks for, and names those that cannot run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput, UnknownName
from wayfarer.fault_scenarios.catalogue.held_by_tests import FaultTest
from wayfarer.fault_scenarios.result import Result, Tried
from wayfarer.fault_scenarios.scenario import Reached, Scenario
from wayfarer.fault_scenarios.scenario_rover import misfit, rover_of
from wayfarer.simhal.build_rover import missing_package

Row = Scenario | FaultTest


def unplayed(row: Row) -> Result:
    """Return the result of a row that was not run: nothing came of it."""
    if isinstance(row, FaultTest):
        tried, level, within_s = Tried.TEST, row.level, row.within_s
    else:
        tried, level, within_s = Tried.SIMULATED, row.expect.level, None
    return Result(
        row.name, row.row, row.about, tried, row.asked, level, Reached.NONE, within_s, "", None, None, "", ()
    )  # fmt: skip


def without_held_by_tests(rows: Sequence[Row]) -> tuple[list[Scenario], list[Result]]:
    """Return the rows that simulated time can show, and the others as skipped, with the test that holds each."""
    elsewhere = [
        unplayed(row)._replace(skipped=f"a test in wayfarer's checkout holds it: pytest {row.test}")
        for row in rows
        if isinstance(row, FaultTest)
    ]
    return [row for row in rows if isinstance(row, Scenario)], elsewhere


def without_missing_packages(rows: Sequence[Scenario]) -> tuple[list[Scenario], list[Result]]:
    """Return the scenarios that can be run with the packages that are installed, and the others as skipped."""
    return _sorted_out((missing_package(rover_of(row), row.depth), row) for row in rows)


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


def on_another_rover(rows: Sequence[Scenario], rover: str) -> tuple[list[Scenario], list[Result]]:
    """Return the scenarios for another rover, and those that it cannot have as skipped.

    Raises:
        UnknownName: no shipped rover of that name.
        BadInput: its file is not right.
    """
    load_rover(rover)
    return _sorted_out(_moved(row, rover) for row in rows)


def _sorted_out(rows: Iterable[tuple[str | None, Scenario]]) -> tuple[list[Scenario], list[Result]]:
    """Return the scenarios that nothing keeps from running, and the others with what does."""
    fitting: list[Scenario] = []
    skipped: list[Result] = []
    for why, row in rows:
        if why:
            skipped.append(unplayed(row)._replace(skipped=why))
        else:
            fitting.append(row)
    return fitting, skipped


def _moved(row: Scenario, rover: str) -> tuple[str, Scenario]:
    """Return why a scenario cannot be run on another rover (nothing where it can), and the scenario for it."""
    moved = replace(row, rover=rover)
    try:
        config = rover_of(moved)
        return next(filter(None, (misfit(config, moved.depth, fault) for fault in moved.faults)), ""), moved
    except BadInput as error:
        return str(error), moved
