"""The fault catalogue in virtual time: each scenario is met within its bound, and each could have failed."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import pytest

from tests.faults.catalogue import ROWS, catalogue
from tests.faults.pages import held_by_tests
from wayfarer.hal import WheelCommand
from wayfarer.simhal.build_rover import missing_package
from wayfarer.testing.faults import ResponseLevel, Scenario, judge
from wayfarer.testing.scenario import rover_of
from wayfarer.testing.scenario_run import RunRecorder, RunResult, run_scenario, run_without_faults, without_faults

SCENARIOS = {each.name: each for each in catalogue()}
ALIKE = {name: repr(without_faults(each)) for name, each in SCENARIOS.items()}  # those with the same run without faults
CAMERA_ROVER = "minirover"  # its pictures take their time to draw and to compare


@lru_cache(maxsize=8)  # a run keeps all of its ticks
def well_run(alike: str) -> RunResult:
    return run_without_faults(next(each for each in SCENARIOS.values() if ALIKE[each.name] == alike))


def runs_of(name: str) -> tuple[RunResult, RunResult]:
    """A scenario's run with its faults, and the one without."""
    return run_scenario(SCENARIOS[name]), well_run(ALIKE[name])


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.long] if SCENARIOS[name].rover == CAMERA_ROVER else [])
        for name in sorted(SCENARIOS, key=lambda name: ALIKE[name])
    ],
)
def test_fault_is_answered_as_the_catalogue_says(name: str) -> None:
    scenario = SCENARIOS[name]
    if why := missing_package(rover_of(scenario), scenario.depth):
        pytest.skip(why)
    runs = runs_of(name)
    assert judge(scenario, *runs).problems == ()
    # A scenario that would pass whatever the rover did, or without its fault, shows nothing.
    other = ResponseLevel.HOLD if scenario.expect.level is ResponseLevel.NONE else ResponseLevel.NONE
    assert not judge(expecting(name, level=other), *runs).passed
    if scenario.expect.level is not ResponseLevel.NONE or scenario.expect.answer:
        assert not judge(expecting(name, within_s=-1.0), *runs).passed
    faulty, _ = runs
    assert "the fault changed nothing that the field code read" in judge(scenario, faulty, faulty).problems


def test_every_row_has_a_scenario_or_a_test_that_the_page_names() -> None:
    assert {each.row for each in SCENARIOS.values()} | set(held_by_tests().values()) == set(range(1, ROWS + 1))


def test_no_two_scenarios_share_a_name() -> None:
    assert len(SCENARIOS) == len(catalogue())


def test_what_must_never_come_fails_a_row_if_it_comes() -> None:
    result = judge(expecting("nose-up", never=("follow.anomaly", "sensor_failed")), *runs_of("nose-up"))
    assert result.problems == ("there was 'follow.anomaly', which must not occur",)


def test_ticks_that_are_too_far_apart_fail_a_row() -> None:
    result = judge(expecting("clock-jumps", ticks_within_s=0.06), *runs_of("clock-jumps"))
    assert result.problems == ("60.03 s between two ticks, 0.06 s are allowed",)


def test_wheels_that_turn_on_for_too_long_fail_a_row() -> None:
    result = judge(expecting("port-gone", stands_within_s=0.2), *runs_of("port-gone"))
    assert result.problems == ("the wheels stopped after 0.30 s, 0.2 s are allowed",)


def test_headings_that_wrap_change_no_decision() -> None:
    """If an angle meets a limit to the last bit of a number, two such drives may part; these do not."""
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


def expecting(name: str, **changed: Any) -> Scenario:
    scenario = SCENARIOS[name]
    return replace(scenario, expect=replace(scenario.expect, **changed))
