"""Selects the scenarios that a command line asks for, and names those that cannot run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput, UnknownName
from wayfarer.fault_scenarios.catalogue import FaultTest
from wayfarer.fault_scenarios.results import Result, Row, not_run
from wayfarer.fault_scenarios.scenario import Scenario, misfit, rover_of
from wayfarer.simhal.build_rover import missing_package

Selected = tuple[list[Scenario], list[Result]]
"""The scenarios that can be run, and the others as skipped."""


def without_covered_by_tests(rows: Sequence[Row]) -> Selected:
    """Select what simulated time can show; the others are skipped, with the test that holds each."""
    elsewhere = [
        not_run(row, f"covered by a test in wayfarer's checkout: pytest -m '' {row.test}")
        for row in rows
        if isinstance(row, FaultTest)
    ]
    return [row for row in rows if isinstance(row, Scenario)], elsewhere


def without_missing_packages(rows: Sequence[Scenario]) -> Selected:
    """Select what can be run with the packages that are installed."""
    return _select(rows, lambda row: missing_package(rover_of(row), row.depth))


def on_another_rover(rows: Sequence[Scenario], rover: str) -> Selected:
    """Select what another rover can have, on that rover.

    Raises:
        UnknownName: no shipped rover of that name.
        BadInput: its file is not right.
    """
    load_rover(rover)
    return _select([replace(row, rover=rover) for row in rows], _misfit)


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
            raise BadInput(f"no scenario and no test has row {item}; --list shows all rows")
        if not found:
            raise UnknownName("scenario", item, {row.name for row in rows})
        wanted += found
    if not wanted:
        raise BadInput("--only is empty; give names or rows, such as --only compass-nack,37")
    return [row for row in rows if row in wanted]


def _select(rows: Sequence[Scenario], why_not: Callable[[Scenario], str | None]) -> Selected:
    reasons = [(row, why_not(row)) for row in rows]
    return [row for row, why in reasons if not why], [not_run(row, why) for row, why in reasons if why]


def _misfit(row: Scenario) -> str | None:
    """Return why a scenario cannot be run on its rover."""
    try:
        config = rover_of(row)
    except BadInput as error:
        return str(error)
    return next(filter(None, (misfit(config, row.depth, fault) for fault in row.faults)), None)
