"""The examples run as they stand."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import pytest

import wayfarer
from tests.experiments.fake_trials import campaign_of
from tests.test_imports import named_in
from wayfarer.experiments.rows import TrialRow

pytestmark = pytest.mark.process  # a second and more each: not a unit test's

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(path.stem for path in FOLDER.glob("*.py"))
SKELETONS = sorted(f"own/{path.stem}" for path in FOLDER.glob("own/*.py"))  # of wayfarer new: tests/cli/test_new.py
LONG = "failsafe_under_a_planner"  # has another stack's planner and rover in it as well

# What each example prints, as regular expressions that are found in this order.
PRINTS = {
    "anomalies_in_a_field_log": [r"s  immobilised  at +\d+\.\d deg, follow\.anomaly", r"log: complete"],
    "campaign_at_a_site": [r"^trial 0: escaped after \d+ s, helped \d", r"forest-pledge: 100 % \[\d+, 100\]"],
    "compare_two_algorithms": [r"^forest-pledge: SPL 0", r"retry-pledge: SPL 0", r"change of SPL in pairs: [+-]0\."],
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
    "tune": [r"^point 0: \d+\.\d\d m after 1 layouts; best: \d+\.\d\d m, point 0\npoint 1: "],
}


# As small as they can be: training and searching take minutes.
ARGUMENTS = {"gym_train_policy": ("1", "2", "1", "1"), "tune": ("2", "1", "1")}

PUBLIC = (
    "wayfarer.escape.", "wayfarer.hal.", "wayfarer.drivers.buses.", "wayfarer.errors.", "wayfarer.testing."
)  # fmt: skip


BUILD_A_ROVER = (LONG, "simulated_chips")  # out of parts of the simulator, in the place of one that is not wayfarer's


@pytest.mark.parametrize("name", [name for name in [*EXAMPLES, *SKELETONS] if name not in BUILD_A_ROVER])
def test_example_uses_nothing_but_what_is_public(name: str) -> None:
    used = {each for each in named_in((FOLDER / f"{name}.py").read_text(encoding="utf-8")) if "wayfarer." in each}
    public = {f"wayfarer.{each}" for each in wayfarer.__all__}
    assert {each for each in used if f"{each}.".startswith(PUBLIC) or each in public} == used


Output = Callable[..., str]


@pytest.fixture
def output_of(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Output:
    """What an example prints as a script, in this process; it must not say anything on stderr."""
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.chdir(tmp_path)  # for what it writes

    def output_of(name: str, *arguments: str) -> str:
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *arguments])
        runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
        told = capfd.readouterr()
        assert not told.err
        return told.out.strip()

    return output_of


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_prints_what_it_shows(name: str, output_of: Output) -> None:
    if name == "trial_in_a_forest":
        pytest.importorskip("skfmm", reason="scikit-fmm is not installed: pip install '.[hardware]'")
    assert re.search(
        ".*".join(f"(?:{line})" for line in PRINTS[name]), output_of(name, *ARGUMENTS.get(name, ())), re.DOTALL
    )


def test_example_runs_as_a_program_of_its_own() -> None:
    command = [sys.executable, str(FOLDER / "simulated_chips.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert (done.stdout.startswith("CMPS14Chip"), done.stderr) == (True, "")


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


# -- the search for settings -------------------------------------------------------------------------------------------


class PathsByAngle:
    """Trials that need no simulator: the nearer the turn angle is to 45 degrees, the shorter is the path."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.trials, self.interrupted_after = 0, -1
        monkeypatch.setattr(wayfarer, "run_trial", self.run_trial)
        monkeypatch.setattr(wayfarer, "run_campaign", self.run_campaign)

    def run_trial(self, number: int, algorithm: str, *, rover: Any, seed: int, **_: Any) -> wayfarer.Trial:
        if self.trials == self.interrupted_after:
            raise KeyboardInterrupt
        self.trials += 1
        path_m = (50.0 + abs(rover.escape.turn_angle_deg - 45.0)) * (1.0 + number / 1000.0)  # no two differences alike
        row = TrialRow(number, algorithm, number, 0, seed, "escaped", path_m=path_m)
        return wayfarer.Trial(row, [], cast(Any, None), cast(Any, None))

    def run_campaign(self, algorithm: str, trials: int, *, rover: Any, seed: int, **_: Any) -> wayfarer.Results:
        rows = [self.run_trial(number, algorithm, rover=rover, seed=seed).row for number in range(trials)]
        return wayfarer.Results(campaign_of(trials, algorithm), rows)


@pytest.fixture
def by_angle(monkeypatch: pytest.MonkeyPatch) -> PathsByAngle:
    return PathsByAngle(monkeypatch)


def test_search_finds_what_matters_and_confirms_it(output_of: Output, by_angle: PathsByAngle, tmp_path: Path) -> None:
    said = output_of("tune", "20", "20", "20")
    angle_deg = float(re.findall(r"^turn_angle_deg = (.*)$", said, re.MULTILINE)[0])
    assert angle_deg == pytest.approx(45.0, abs=5.0)
    assert re.search(r"given up after 1\d layouts", said), "by Wilcoxon's test"
    assert re.search(
        r"success_percent_change \+0\.00 .*\nheld out: path_m_change -1\d\.\d\d \[.*\na gain; for the rover", said
    )
    assert by_angle.trials < 20 * 20
    assert {each.name for each in (tmp_path / "tuned").iterdir()} == {"study.journal", "history.png", "settings.png"}


def test_search_takes_fewer_numbers_and_refuses_others_in_one_line(output_of: Output, by_angle: PathsByAngle) -> None:
    by_angle.interrupted_after = 0
    for fewer in ("1", "1 9"):
        with pytest.raises(SystemExit, match="run this again"):
            output_of("tune", *fewer.split())
    for others in ("none", "0", "-5 9", "1 9 9 9"):
        with pytest.raises(SystemExit, match=r"^give up to three whole numbers above 0: POINTS LAYOUTS HELD_OUT$"):
            output_of("tune", *others.split())


def test_search_goes_on_where_it_was_interrupted(output_of: Output, by_angle: PathsByAngle) -> None:
    by_angle.interrupted_after = 25
    with pytest.raises(SystemExit, match="run this again, and it goes on"):
        output_of("tune", "10", "9", "9")
    by_angle.interrupted_after = -1
    said = output_of("tune", "10", "9", "9")
    numbers = [int(number) for number in re.findall(r"^point (\d+): ", said, re.MULTILINE)]
    assert numbers == [0, 1, 3, 4, 5, 6, 7, 8, 9, 10], "the third was cut short; the current settings only once"
    assert "no gain is shown" in said, "of fewer than ten layouts nothing is"
