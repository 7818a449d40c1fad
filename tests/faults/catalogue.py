"""The fault catalogue: the scenarios in the TOML files of this folder, by row."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from wayfarer.testing.scenario import Scenario, read_scenarios

ROWS = 60  # of the fault catalogue


@cache
def catalogue() -> tuple[Scenario, ...]:
    """Return every scenario of the catalogue, in the order of rows."""
    scenarios = [scenario for path in sorted(Path(__file__).parent.glob("*.toml")) for scenario in read_scenarios(path)]
    return tuple(sorted(scenarios, key=lambda each: each.row or 0))
