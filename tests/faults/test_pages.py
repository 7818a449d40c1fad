"""The pages on faults: every kind and scenario, the tests of what cannot be simulated, and what stopped the wheels."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from benchmarks.detector import CASES, HEADER
from tests.faults import pages
from tests.faults.catalogue import catalogue
from wayfarer.escape.api import Anomaly
from wayfarer.testing.faults import Scenario, read_scenarios, run_fault_scenario

CHECKOUT = Path(__file__).parents[2]
QUICK = ("compass-nack", "motors-nack", "loop-stall-thunderborg", "board-fault")


def written(page: Path, name: str) -> str:
    """A part of a page, as it is there."""
    _, text, _ = pages.part(page.read_text(encoding="utf-8"), name)
    return text


def cells(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()[2:]]


@pytest.mark.parametrize("layer", [*pages.LAYERS, "reading"])
def test_page_has_every_kind_with_its_parameters(layer: str) -> None:
    assert written(pages.FAULTS, layer) == pages.kinds(layer)


def test_page_has_every_scenario_of_the_catalogue() -> None:
    assert written(pages.FAULTS, "catalogue") == pages.catalogue_table()


@pytest.mark.parametrize("test", pages.held_by_tests())
def test_test_that_the_page_names_is_there(test: str) -> None:
    file, _, function = test.partition("::")
    module = ast.parse((CHECKOUT / file).read_text(encoding="utf-8"))
    assert function in {node.name for node in module.body if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}


def test_pages_scenarios_are_met(tmp_path: Path) -> None:
    path = tmp_path / "my-faults.toml"
    path.write_text(pages.FAULTS.read_text(encoding="utf-8").partition("```toml\n")[2].partition("```")[0])
    scenarios = read_scenarios(path)
    assert [each.name for each in scenarios] == ["leaf-on-the-lens", "iron-and-a-loose-wire"]
    assert [run_fault_scenario(each).problems for each in scenarios] == [(), ()]


# -- docs/explanation/what-stops-the-wheels.md -------------------------------------------------------------------------


def test_every_scenario_that_is_to_stop_the_wheels_has_its_line_with_its_bound() -> None:
    wanted = {
        (each.name, each.expect.level.value, f"{each.expect.within_s:.2f}")
        for each in catalogue()
        if each.expect.level.value in {"S2", "S3", "S4"}
    }
    assert {(line[1].strip("`"), line[3], line[6]) for line in cells(written(pages.STOPS, "stops"))} == wanted


def test_nothing_took_longer_than_its_bound() -> None:
    timed = [line for line in cells(written(pages.STOPS, "stops")) if line[5] and line[6]]
    assert len(timed) > 30
    assert [line for line in timed if float(line[5]) > float(line[6])] == []


@pytest.mark.long
def test_lines_are_what_the_scenarios_give() -> None:
    """Simulated times are the same at each run, so the page can be held to them."""
    scenarios: list[Scenario] = [each for each in catalogue() if each.name in QUICK]
    lines = pages.stops((each, run_fault_scenario(each)) for each in scenarios).splitlines()[2:]
    assert len(lines) == len(QUICK)
    assert set(lines) <= set(written(pages.STOPS, "stops").splitlines())


def test_detector_is_told_for_each_anomaly_at_each_slip_mean_and_noise() -> None:
    wanted = {
        (f"`{anomaly.value}`", f"{case.slip_mean_m:g}", f"{case.noise:g}x") for anomaly in Anomaly for case in CASES
    }
    detector = written(pages.STOPS, "detector")
    assert detector.startswith(f"| {' | '.join(HEADER)} |\n")
    assert {tuple(line[:3]) for line in cells(detector)} == wanted
