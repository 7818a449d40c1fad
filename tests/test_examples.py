"""The examples run as they stand."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import wayfarer
from tests.test_imports import named_in

pytestmark = pytest.mark.process  # a second and more each: not a unit test's

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(path.stem for path in FOLDER.glob("*.py"))
LONG = "failsafe_under_a_planner"  # has another stack's planner and rover in it as well

# What each example prints, as regular expressions that are found in this order.
PRINTS = {
    "algorithm_of_your_own": [r"left_hand: (escaped|left_bounds) after \d+\.\d m"],
    "anomalies_in_a_field_log": [r"s  immobilised  at +\d+\.\d deg, follow\.anomaly", r"log: complete"],
    "campaign_at_a_site": [r"^trial 0: escaped after \d+ s, helped \d", r"forest-pledge: 100 % \[\d+, 100\]"],
    "compare_two_algorithms": [r"^forest-pledge: SPL 0", r"memory-pledge: SPL 0", r"gain of SPL in pairs: [+-]0\."],
    "driver_of_your_own": [r"^b'Z'", r"b'n\\xff\\x99\\x00'", r"b'n\\x00\\x00\\x00'$"],
    "escape_handler_alone": [r"follow\.anomaly", r"back_off\.done", r"turn_away\.done", r"probe\.realigned"],
    "failsafe_under_a_planner": [r"^the planner alone: still", r"the handler drives", r"with the fail-safe: out"],
    "fault_in_a_trial": [r"^S2 by compass_stale after 0\.", r"as expected$"],
    "gym_train_policy": [
        r"^generation 1: best",
        r"rule of thumb: out .* of 1,",
        r"forest-pledge: out of the forest in 1 of 1,",
    ],
    "gym_forest_pledge": [r"^trial 7, forest-pledge: escaped after"],
    "replay_a_log": [r"^as logged: \d+ decisions, then the end", r"patient: .* key='anomalies'"],
    "simulated_chips": [r"^CMPS14Chip"],
    "trial_in_a_forest": [r"^trial +7", r"outcome +(escaped|left_bounds)", r"spl +0\.\d", r"it probed for \d"],
}


ARGUMENTS = {"gym_train_policy": ("1", "2", "1", "1")}  # as small as it can be; its training takes minutes

PUBLIC = (
    "wayfarer.escape.", "wayfarer.hal.", "wayfarer.drivers.buses.", "wayfarer.errors.", "wayfarer.testing."
)  # fmt: skip


BUILD_A_ROVER = (LONG, "simulated_chips")  # out of parts of the simulator, in the place of one that is not wayfarer's


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name not in BUILD_A_ROVER])
def test_example_uses_nothing_but_what_is_public(name: str) -> None:
    used = {each for each in named_in((FOLDER / f"{name}.py").read_text(encoding="utf-8")) if "wayfarer." in each}
    public = {f"wayfarer.{each}" for each in wayfarer.__all__}
    assert {each for each in used if f"{each}.".startswith(PUBLIC) or each in public} == used


Output = Callable[..., str]


@pytest.fixture
def output_of(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Output:
    """What an example prints as a script, in this process; it must not say anything on stderr."""
    monkeypatch.syspath_prepend(FOLDER)

    def output_of(name: str, *arguments: str) -> str:
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *arguments])
        runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
        told = capfd.readouterr()
        assert not told.err
        return told.out.strip()

    return output_of


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_prints_what_it_shows(name: str, output_of: Output) -> None:
    assert re.search(
        ".*".join(f"(?:{line})" for line in PRINTS[name]), output_of(name, *ARGUMENTS.get(name, ())), re.DOTALL
    )


def test_example_runs_as_a_program_of_its_own() -> None:
    command = [sys.executable, str(FOLDER / "trial_in_a_forest.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert (done.stdout.startswith("trial            7"), done.stderr) == (True, "")


@pytest.fixture(scope="module")
def failsafe_example() -> dict[str, Any]:
    return runpy.run_path(str(FOLDER / f"{LONG}.py"))


@pytest.mark.parametrize("forest", [0, 2, 4])
def test_failsafe_gets_out_where_the_planner_alone_stays_stuck(failsafe_example: dict[str, Any], forest: int) -> None:
    drive, make_failsafe = failsafe_example["drive"], failsafe_example["make_failsafe"]
    alone, guarded = drive(forest, None), drive(forest, make_failsafe(forest))
    assert (alone.out, alone.takeovers) == (False, 0)
    assert guarded.out
    assert guarded.takeovers > 0
    assert guarded.time_s < alone.time_s / 2


def test_agent_of_the_catalogue_ends_as_the_trial_of_that_number(output_of: Output) -> None:
    result = wayfarer.run_trial(7).row
    assert f"{result.outcome} after {result.path_m:.1f} m, {result.time_s:.2f} s" in output_of("gym_forest_pledge", "7")
