"""The examples run as they stand."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.trial import run_trial

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example: Path) -> None:
    done = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, check=True)
    assert done.stdout
    assert not done.stderr


def test_escape_handler_alone_goes_through_a_whole_episode() -> None:
    example = next(path for path in EXAMPLES if path.stem == "escape_handler_alone")
    done = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, check=True)
    events = [line.split()[2] for line in done.stdout.splitlines()]
    assert events == ["follow.anomaly", "back_off.done", "turn_away.done", "probe.realigned"]


@pytest.fixture(scope="module")
def failsafe_example() -> dict[str, Any]:
    return runpy.run_path(str(next(path for path in EXAMPLES if path.stem == "failsafe_under_a_planner")))


@pytest.mark.parametrize("forest", [0, 2, 4])
def test_failsafe_gets_out_where_the_planner_alone_stays_stuck(failsafe_example: dict[str, Any], forest: int) -> None:
    drive, make_failsafe = failsafe_example["drive"], failsafe_example["make_failsafe"]
    alone, guarded = drive(forest, None), drive(forest, make_failsafe(forest))
    assert (alone.out, alone.takeovers) == (False, 0)
    assert guarded.out
    assert guarded.takeovers > 0
    assert guarded.time_s < alone.time_s / 2


def test_agent_of_the_catalogue_ends_as_the_trial_of_that_number() -> None:
    example = next(path for path in EXAMPLES if path.stem == "gym_forest_pledge")
    told = subprocess.run([sys.executable, str(example), "7"], capture_output=True, text=True, check=True).stdout
    campaign = Campaign(("forest-pledge",), 8, load_rover("sim"))
    result = run_trial(campaign.spec(Task("forest-pledge", 7), campaign.make_forest(7)))
    assert f"{result.outcome} after {result.path_m:.1f} m, {result.time_s:.2f} s" in told
