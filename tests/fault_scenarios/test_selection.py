"""Which scenarios are run: by name, by row, and on another rover."""

from __future__ import annotations

import sys
from dataclasses import replace

import pytest

from wayfarer.fault_scenarios.catalogue import ROWS, FaultTest, catalogue
from wayfarer.fault_scenarios.results import Row
from wayfarer.fault_scenarios.scenario import Expectation, ResponseLevel, Scenario
from wayfarer.fault_scenarios.selection import (
    chosen,
    on_another_rover,
    without_covered_by_tests,
    without_missing_packages,
)
from wayfarer.simhal.build_rover import Depth
from wayfarer.simhal.faults.kinds import Fault


def scenario(name: str, row: int, fault: Fault) -> Scenario:
    return Scenario(name, "", Expectation(ResponseLevel.HOLD, 1.0), (fault,), row=row)


LOOSE = scenario("loose", 2, Fault(1.0, 1.0, "compass", "nack"))
DARK = scenario("dark", 15, Fault(1.0, 1.0, "motion", "dark"))
BUMPED = scenario("bumped", 15, Fault(1.0, 1.0, "contact", "silent"))
KILLED = FaultTest(
    "killed", 35, "it is killed", "S4 stops", ResponseLevel.DEADMAN, "tests/test_it.py::test_killed", 0.3
)
SCENARIOS = [LOOSE, DARK, BUMPED]
ALL: list[Row] = [*SCENARIOS, KILLED]


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ("loose", ["loose"]),
        ("15", ["dark", "bumped"]),
        ("35, loose", ["loose", "killed"]),
        ("dark,15,dark", ["dark", "bumped"]),
    ],
)
def test_names_and_rows_are_chosen_once_in_the_order_of_the_catalogue(asked: str, names: list[str]) -> None:
    assert [row.name for row in chosen(ALL, asked)] == names


def test_what_a_test_holds_is_skipped_and_the_test_is_named() -> None:
    scenarios, (skipped,) = without_covered_by_tests(ALL)
    assert scenarios == SCENARIOS
    assert (skipped.name, skipped.row, skipped.about, skipped.asked) == ("killed", 35, "it is killed", "S4 stops")
    assert (skipped.expected, skipped.within_s) == (ResponseLevel.DEADMAN, 0.3)
    assert skipped.skipped == "covered by a test in wayfarer's checkout: pytest -m '' tests/test_it.py::test_killed"


def test_another_rover_leaves_out_what_it_cannot_have() -> None:
    rows, skipped = on_another_rover(SCENARIOS, "minirover")
    assert [(row.name, row.rover) for row in rows] == [("loose", "minirover"), ("dark", "minirover")]
    assert [(each.name, each.row, each.skipped) for each in skipped] == [
        ("bumped", 15, "rover 'minirover' has no [parts.contact]"),
    ]


def test_without_opencv_a_camera_at_bus_depth_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    by_camera = replace(DARK, rover="minirover")
    at_device_depth = replace(by_camera, depth=Depth.DEVICE)
    monkeypatch.setitem(sys.modules, "cv2", None)  # what Python takes for "not installed"
    rows, (skipped,) = without_missing_packages([LOOSE, by_camera, at_device_depth])
    assert (rows, skipped.name) == ([LOOSE, at_device_depth], "dark")
    assert "needs cv2 for [parts.motion], which is not installed" in skipped.skipped


def test_catalogue_tries_every_row_and_names_each_scenario_once() -> None:
    rows = catalogue()
    assert {row.row for row in rows} == set(range(1, ROWS + 1))
    assert sorted({row.name for row in rows}) == sorted(row.name for row in rows)
    assert [row.row for row in rows] == sorted(row.row or 0 for row in rows)
