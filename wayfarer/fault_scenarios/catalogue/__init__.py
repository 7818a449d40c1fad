"""The fault catalogue's faults: scenarios in the TOML files beside this one, and what tests hold instead."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

from wayfarer.fault_scenarios.catalogue.covered_by_tests import COVERED_BY_TESTS, FaultTest
from wayfarer.fault_scenarios.scenario import Scenario
from wayfarer.fault_scenarios.scenario_file import read_scenarios

ROWS = 60  # of the fault catalogue


@cache
def catalogue() -> tuple[Scenario | FaultTest, ...]:
    """Return everything that tries a row of the fault catalogue, in the order of rows."""
    return tuple(sorted([*_scenarios(), *COVERED_BY_TESTS.values()], key=lambda each: each.row or 0))


def _scenarios() -> Iterator[Scenario]:
    for path in sorted(Path(__file__).parent.glob("*.toml")):
        yield from read_scenarios(path)
