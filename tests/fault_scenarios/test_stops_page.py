"""``docs/explanation/what-stops-the-wheels.md`` tells of all that stops them, with the bounds of the catalogue."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.detector import CASES, HEADER
from tests.fault_scenarios.stops_page import STOPPING, STOPS_HEAD, stops
from wayfarer.escape.api import Anomaly
from wayfarer.fault_scenarios.catalogue import catalogue
from wayfarer.fault_scenarios.judge import judge
from wayfarer.fault_scenarios.runner import run_scenario, run_without_faults
from wayfarer.fault_scenarios.scenario import Scenario

PAGE = (Path(__file__).parents[2] / "docs" / "explanation" / "what-stops-the-wheels.md").read_text(encoding="utf-8")
QUICK = ("compass-nack", "motors-nack", "loop-stall-thunderborg", "board-fault")


def table(name: str, head: str) -> list[list[str]]:
    """The cells of a table that is between its marks."""
    text = PAGE.partition(f"<!-- {name} -->\n")[2].partition(f"\n<!-- /{name} -->")[0]
    assert text.startswith(head)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()[2:]]


def scenarios() -> dict[str, Scenario]:
    return {row.name: row for row in catalogue() if isinstance(row, Scenario)}


def test_every_scenario_that_is_to_stop_the_wheels_has_its_line_with_its_bound() -> None:
    wanted = {
        (name, each.expect.level.value, f"{each.expect.within_s:.2f}")
        for name, each in scenarios().items()
        if each.expect.level.value in STOPPING
    }
    told = {(line[1].strip("`"), line[3], line[6]) for line in table("stops", STOPS_HEAD)}
    assert told == wanted


def test_nothing_took_longer_than_its_bound() -> None:
    timed = [line for line in table("stops", STOPS_HEAD) if line[5] and line[6]]
    assert len(timed) > 30
    assert [line for line in timed if float(line[5]) > float(line[6])] == []


@pytest.mark.long
def test_lines_are_what_the_scenarios_give() -> None:
    """Simulated times are the same at each run, so the page can be held to them."""
    rows = [scenarios()[name] for name in QUICK]
    results = [judge(row, run_scenario(row), run_without_faults(row)) for row in rows]
    for line in stops([each._asdict() for each in results]):
        assert f"\n{line}\n" in PAGE


def test_detector_is_told_for_each_anomaly_at_each_slip_mean_and_noise() -> None:
    wanted = {
        (f"`{anomaly.value}`", f"{case.slip_mean_m:g}", f"{case.noise:g}x") for anomaly in Anomaly for case in CASES
    }
    assert {tuple(line[:3]) for line in table("detector", f"| {' | '.join(HEADER)} |\n")} == wanted
