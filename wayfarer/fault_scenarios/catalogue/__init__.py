"""The fault catalogue: scenarios in the TOML files beside this one, and in ``tests.toml`` what tests hold instead."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from wayfarer.fault_scenarios.scenario import ResponseLevel, Scenario
from wayfarer.fault_scenarios.scenario_file import read_scenarios

ROWS = 60  # of the fault catalogue
TESTS_FILE = "tests.toml"


class FaultTest(NamedTuple):
    """A fault that a test makes happen: mostly to the real daemon, as a process over simulated chips.

    ``asked`` is what the fault catalogue asks for, ``level`` and ``within_s`` what the test holds the rover to.
    ``within_s`` is None where nothing is timed; where the motor board's deadman stops the wheels, it is that of the
    slower board. ``test`` is the test's name for pytest.
    """

    name: str
    row: int
    about: str
    asked: str
    level: ResponseLevel
    test: str
    within_s: float | None = None


@cache
def covered_by_tests() -> dict[str, FaultTest]:
    """Return the rows that no simulated run can show, by name."""
    tables = tomllib.loads((Path(__file__).parent / TESTS_FILE).read_text(encoding="utf-8"))["test"]
    return {table["name"]: FaultTest(**{**table, "level": ResponseLevel(table["level"])}) for table in tables}


@cache
def catalogue() -> tuple[Scenario | FaultTest, ...]:
    """Return everything that tries a row of the fault catalogue, in the order of rows."""
    files = sorted(path for path in Path(__file__).parent.glob("*.toml") if path.name != TESTS_FILE)
    scenarios = [scenario for path in files for scenario in read_scenarios(path)]
    return tuple(sorted([*scenarios, *covered_by_tests().values()], key=lambda each: each.row or 0))
