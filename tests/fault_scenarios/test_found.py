"""What broke a safety rule in trials by chance, as the smallest scenario that did, and does no more."""

from __future__ import annotations

from pathlib import Path

import pytest

from wayfarer.fault_scenarios.random_runs import broken_rules
from wayfarer.fault_scenarios.runner import run_scenario
from wayfarer.fault_scenarios.scenario_file import read_scenarios

FOUND = sorted((Path(__file__).parent / "found").glob("*.toml"))


def test_there_are_some() -> None:
    assert len(FOUND) >= 3


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.stem)
def test_scenario_breaks_no_rule_any_more(path: Path) -> None:
    (scenario,) = read_scenarios(path)
    assert broken_rules(run_scenario(scenario)) == ()
