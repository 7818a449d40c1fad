"""The fault catalogue's rows that run in virtual time: each is met within its bound, and each could have failed."""

from __future__ import annotations

import ast
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from wayfarer.fault_scenarios.catalogue import FaultTest, catalogue, covered_by_tests
from wayfarer.fault_scenarios.command import ScenarioRunner
from wayfarer.fault_scenarios.judge import judge
from wayfarer.fault_scenarios.recorder import RunRecorder
from wayfarer.fault_scenarios.runner import RunResult, without_faults
from wayfarer.fault_scenarios.scenario import ResponseLevel, Scenario
from wayfarer.hal import WheelCommand

CHECKOUT = Path(__file__).parents[2]
SCENARIOS = {each.name: each for each in catalogue() if isinstance(each, Scenario)}
SIMULATED_ROWS = {*range(1, 12), *range(13, 19), *range(20, 33), 37, 38, 46, 51, *range(54, 61)}
CAMERA_ROVER = "minirover"  # its pictures take their time to draw and to compare


RUNNER = ScenarioRunner()


@cache
def runs_of(name: str) -> tuple[RunResult, RunResult]:
    return RUNNER.runs(SCENARIOS[name])


def rows() -> list[object]:
    """The rows, beside each other those that share a run without faults: the runner remembers a few."""
    ordered = sorted(SCENARIOS.values(), key=lambda scenario: repr(without_faults(scenario)))
    long = [pytest.mark.long]
    return [pytest.param(each.name, marks=long if each.rover == CAMERA_ROVER else []) for each in ordered]


@pytest.mark.parametrize("fault", covered_by_tests().values(), ids=covered_by_tests())
def test_test_that_holds_a_fault_is_there(fault: FaultTest) -> None:
    file, _, function = fault.test.partition("::")
    module = ast.parse((CHECKOUT / file).read_text(encoding="utf-8"))
    assert function in {node.name for node in module.body if isinstance(node, ast.FunctionDef)}


def test_every_row_that_virtual_time_can_show_is_there() -> None:
    assert {scenario.row for scenario in SCENARIOS.values()} == SIMULATED_ROWS


@pytest.mark.parametrize("name", rows())
def test_row_is_met_within_its_bound(name: str) -> None:
    result = judge(SCENARIOS[name], *runs_of(name))
    assert result.problems == ()


@pytest.mark.parametrize("name", rows())
def test_row_fails_where_its_bound_is_impossible(name: str) -> None:
    """A row that would pass whatever the rover did shows nothing."""
    scenario = SCENARIOS[name]
    other = ResponseLevel.HOLD if scenario.expect.level is ResponseLevel.NONE else ResponseLevel.NONE
    assert not judge(with_expectation(scenario, level=other), *runs_of(name)).passed
    if scenario.expect.level is not ResponseLevel.NONE or scenario.expect.answer:
        assert not judge(with_expectation(scenario, within_s=-1.0), *runs_of(name)).passed


@pytest.mark.parametrize("name", rows())
def test_row_fails_where_its_fault_changes_nothing(name: str) -> None:
    faulty, _ = runs_of(name)
    assert "the fault changed nothing that the field code read" in judge(SCENARIOS[name], faulty, faulty).problems


def test_what_must_never_come_fails_a_row_if_it_comes() -> None:
    result = judge(
        with_expectation(SCENARIOS["nose-up"], never=("follow.anomaly", "sensor_failed")), *runs_of("nose-up")
    )
    assert result.problems == ("there was 'follow.anomaly', which must not occur",)


def test_ticks_that_are_too_far_apart_fail_a_row() -> None:
    result = judge(with_expectation(SCENARIOS["clock-jumps"], ticks_within_s=0.06), *runs_of("clock-jumps"))
    assert result.problems == ("60.03 s between two ticks, 0.06 s are allowed",)


def test_wheels_that_turn_on_for_too_long_fail_a_row() -> None:
    result = judge(with_expectation(SCENARIOS["port-gone"], stands_within_s=0.2), *runs_of("port-gone"))
    assert result.problems == ("the wheels stopped after 0.30 s, 0.2 s are allowed",)


def test_headings_that_wrap_change_no_decision() -> None:
    """Where an angle meets a limit to the last bit of a number, two such drives may part; these do not."""
    south, north = (run_result.recorder for run_result in runs_of("heading-wrap"))
    assert wraps(north) > wraps(south) + 50
    assert any(moment.why == "follow.anomaly" for moment in north.ticks), "no turn was made"
    assert decisions(north) == decisions(south)


def decisions(recorder: RunRecorder) -> list[tuple[float, str, WheelCommand]]:
    return [(moment.t_s, moment.why, moment.applied) for moment in recorder.ticks]


def wraps(recorder: RunRecorder) -> int:
    """How often the heading went across north from one tick to the next."""
    readings = [moment.snapshot.compass for moment in recorder.ticks]
    headings = [reading.heading_deg for reading in readings if reading is not None]
    return sum(abs(now - last) > 180.0 for last, now in pairwise(headings))


def with_expectation(scenario: Scenario, **changed: object) -> Scenario:
    return replace(scenario, expect=replace(scenario.expect, **changed))  # type: ignore[arg-type]
