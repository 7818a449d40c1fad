"""Judging scenarios: what was reached and when, and that a scenario which should fail does fail."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path

import pytest

from tests.kit.logs import read_log
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.process import LoopStall
from wayfarer.simhal.faults.world import Slope
from wayfarer.simhal.world.physics import Depth
from wayfarer.testing.faults import Result, judge, run_fault_scenario
from wayfarer.testing.scenario import Command, Expectation, ResponseLevel, Scenario
from wayfarer.testing.scenario_run import RunResult, run_scenario, run_without_faults

BEGINS_S = 3.0
LOOSE = Fault(BEGINS_S, inf, "compass", "nack")
HELD = Expectation(ResponseLevel.HOLD, 0.4, ("compass_stale",))


def scenario(fault: Fault = LOOSE, expect: Expectation = HELD, **others: object) -> Scenario:
    """A short scenario in a clearing, on a rover that drives from 0.5 s on."""
    made = Scenario(
        name="a", expect=expect, faults=(fault,), for_s=6.0, clearing=True, seed=1,
        settings={"safety": {"start_delay_s": 0.5}},
    )  # fmt: skip
    return replace(made, **others)  # type: ignore[arg-type]


@cache
def runs(key: str) -> tuple[Scenario, RunResult, RunResult]:
    """A scenario and its two runs, made once."""
    made = SCENARIOS[key]
    return made, run_scenario(made), run_without_faults(made)


SCENARIOS = {
    "loose plug": scenario(),
    "stall": scenario(Fault(BEGINS_S, 1.0, "process", "loop_stall", LoopStall(1.0))),
    "crash": scenario(Fault(BEGINS_S, inf, "compass", "task_crash")),
    "disarmed": scenario(commands=()),
    "dead line": scenario(Fault(BEGINS_S, inf, "motors", "nack")),
    "nothing": scenario(Fault(BEGINS_S, 1.0, "world", "slope", Slope())),
    "held by a person": scenario(
        Fault(BEGINS_S, inf, "compass", "offset"), commands=(Command(0.0, "arm", 0.0), Command(4.0, "hold"))
    ),
    "too late": scenario(commands=(Command(0.0, "arm"), Command(2.0, "stop"))),
}


def judged(key: str, expect: Expectation = HELD) -> Result:
    """What comes of a scenario if this was expected of it."""
    made, run_result, well = runs(key)
    return judge(replace(made, expect=expect), run_result, well)


def test_level_bound_and_change_of_a_fault_that_is_met() -> None:
    result = judged("loose plug")
    assert result.passed, result.problems
    assert (result.reached, result.cause) == (ResponseLevel.HOLD, "compass_stale")
    assert result.changed.startswith("compass: an older reading at +0.0")
    assert result.detected_s == result.stopped_s
    assert 0.25 <= (result.detected_s or 0.0) <= 0.4


WRONG = {
    "bound": (replace(HELD, within_s=0.1), "detected after 0."),
    "bound of the stop": (replace(HELD, within_s=0.1), "the wheels stopped after 0."),
    "level above": (replace(HELD, level=ResponseLevel.FAULT), "S2 was reached, S3 is expected; the rover said"),
    "level below": (replace(HELD, level=ResponseLevel.NOTE), "S2 was reached, S0 is expected"),
    "no level": (replace(HELD, level=ResponseLevel.NONE), "S2 was reached, - is expected"),
    "cause": (
        replace(HELD, causes=("battery_low",)),
        "- was reached, S2 is expected; the rover said compass_stale (S2)",
    ),
    "event": (replace(HELD, event="disarmed"), "no event 'disarmed' in the log"),
    "end": (replace(HELD, ends=("mission_time",)), "the run ended by 'requested', expected is mission_time"),
    "deadman": (replace(HELD, level=ResponseLevel.DEADMAN), "S2 was reached, S4 is expected"),
}


@pytest.mark.parametrize(("expect", "says"), WRONG.values(), ids=WRONG)
def test_scenario_that_expects_something_else_fails_and_says_what(expect: Expectation, says: str) -> None:
    result = judged("loose plug", expect)
    assert not result.passed
    assert any(says in problem for problem in result.problems), result.problems


def test_events_count_where_they_are_named_as_causes() -> None:
    noted = judged("loose plug", Expectation(ResponseLevel.NOTE, 0.1, ("sensor_failed",)))
    assert noted.passed, noted.problems
    assert noted.stopped_s is None


def test_fault_that_changes_nothing_for_the_field_code_fails() -> None:
    result = judged("nothing", Expectation(ResponseLevel.NONE, 0.0))
    assert result.problems == ("the fault changed nothing that the field code read",)


def test_fault_that_never_began_fails() -> None:
    assert judged("too late").problems == ("no fault began before the run was over",)


def test_task_that_crashes_ends_the_run_and_is_a_fault() -> None:
    result = judged("crash", Expectation(ResponseLevel.FAULT, 0.1, ("failed",), ends=("failed",)))
    assert result.passed, result.problems
    assert (result.cause, result.stopped_s) == ("failed", result.detected_s)


def test_crash_that_nobody_expects_fails() -> None:
    result = judged("crash", Expectation(ResponseLevel.FAULT, 0.1))
    assert result.problems == ("the run ended by an error: Bug: a bug in a driver, injected",)


def test_hold_of_a_single_tick_counts() -> None:
    result = judged("stall", Expectation(ResponseLevel.HOLD, 1.1, ("tick_late",)))
    assert result.passed, result.problems
    _, run_result, _ = runs("stall")
    assert sum("tick_late" in {each.value for each in moment.conditions} for moment in run_result.recorder.ticks) == 1


def test_wheels_that_a_boards_deadman_stops_have_reached_s4() -> None:
    for key in ("stall", "dead line"):
        result = judged(key, Expectation(ResponseLevel.DEADMAN, 0.4))
        assert result.passed, result.problems
        assert 0.2 <= (result.stopped_s or 0.0) <= 0.4


def test_wheels_that_stood_before_the_fault_stood_already() -> None:
    result = judged("disarmed")
    assert result.passed, result.problems
    assert result.stopped_s == 0.0


def test_what_a_person_does_is_no_answer_to_a_fault() -> None:
    result = judged("held by a person", Expectation(ResponseLevel.NONE, 0.0))
    assert "operator_hold" not in (result.cause, *result.problems)


def test_a_broken_rule_fails_whatever_is_expected() -> None:
    made, run_result, well = runs("loose plug")
    result = judge(made, run_result._replace(broken=("3.30 s: motion commanded while disarmed",)), well)
    assert result.problems == ("broken rule: 3.30 s: motion commanded while disarmed",)


def test_runs_that_differ_before_the_fault_prove_nothing() -> None:
    made, run_result, _ = runs("loose plug")
    other = run_without_faults(replace(made, seed=2))
    assert any(
        "the runs differ before the fault began" in problem for problem in judge(made, run_result, other).problems
    )


def test_same_scenario_gives_the_same_result() -> None:
    made = scenario(depth=Depth.BUS)
    first, second = (judge(made, run_scenario(made), run_without_faults(made)) for _ in range(2))
    assert first == second


def test_log_of_the_run_with_the_fault_has_it_as_ground_truth(tmp_path: Path) -> None:
    assert run_fault_scenario(scenario(replace(LOOSE, for_s=1.0)), tmp_path).passed
    faults = [record for record in read_log(tmp_path) if record["record"] == "fault"]
    assert [(each["t_s"], each["target"], each["kind"], each["begins"]) for each in faults] == [
        (3.0, "compass", "nack", True),
        (4.0, "compass", "nack", False),
    ]
