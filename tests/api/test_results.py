"""Campaigns, sweeps and comparisons from Python: the rows of the commands."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import wayfarer
from tests.conftest import Run
from tests.experiments.fake_trials import campaign_of, quick
from wayfarer.escape.catalogue import BUILT_IN
from wayfarer.experiments import run as runner
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec

BOTH = ["forest-pledge", "pledge"]
# Two trials a second: a rover that may drive 15 m.
SHORT = ("--trials", 3, "--budget-m", 15, "--seed", 4, "--jobs", 1)
short = partial(wayfarer.run_campaign, BOTH, trials=3, budget_m=15.0, seed=4)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("out") / "results"


@pytest.fixture(scope="module")
def results(out: Path) -> wayfarer.Results:
    return short(out=out)


def test_rows_are_those_of_the_command(results: wayfarer.Results, out: Path, run: Run, tmp_path: Path) -> None:
    assert run("sim", "--algorithm", ",".join(BOTH), *SHORT, "--out", tmp_path / "out")[0] == 0
    assert (tmp_path / "out/trials.csv").read_bytes() == (out / "trials.csv").read_bytes()


def test_same_seed_gives_equal_rows(results: wayfarer.Results) -> None:
    again = short()
    assert again.trials == results.trials
    assert again.settings == results.settings


def test_pandas_reads_the_table_as_it_is(tmp_path: Path) -> None:
    """What is whole, has a fraction, or is not known."""
    results = wayfarer.run_campaign(BOTH, trials=2, forests="reference", budget_m=40.0, out=tmp_path)
    read = pd.read_csv(tmp_path / "trials.csv")
    assert [str(read[name].dtype) for name in ("trial", "seed", "path_m", "spl")] == ["int64"] * 2 + ["float64"] * 2
    assert read.astype(object).where(read.notna(), None).to_dict("records") == results.trials
    assert list(pd.DataFrame(results.trials)) == list(read)


def test_folder_gives_the_same_results_as_the_run(results: wayfarer.Results, out: Path) -> None:
    opened = wayfarer.open_results(out)
    assert (opened.rows, opened.settings) == (results.rows, results.settings)
    assert repr(opened) == "<Results: 6 trials of forest-pledge, pledge>"


def test_trial_alone_is_that_of_the_campaign(results: wayfarer.Results) -> None:
    trial = wayfarer.run_trial(2, "pledge", budget_m=15.0, seed=4)
    assert results.rows[-1] == trial.row
    assert wayfarer.run_trial(0, budget_m=1.0, set={"sim.slope_deg": "2:4"}).row.drawn.keys() == {"sim.slope_deg"}


def test_summary_has_the_numbers_of_the_command(results: wayfarer.Results, run: Run) -> None:
    _, said, _ = run("sim", "--algorithm", ",".join(BOTH), *SHORT, "--json")
    table = json.loads(said)["table"]
    assert [row["algorithm"] for row in table] == BOTH
    for row, written in zip(results.summary, table, strict=True):
        assert row == pytest.approx(written, abs=1e-4)
    assert [row["trials"] for row in results.summary] == [3, 3]


def test_comparison_has_the_numbers_of_the_command(results: wayfarer.Results, out: Path, run: Run) -> None:
    code, said, _ = run("compare", str(out), "--against", "pledge", "--json")
    base, other = json.loads(said)["algorithms"]
    rows = wayfarer.compare(results, against="pledge")
    assert (code, [row["algorithm"] for row in rows]) == (0, [base["algorithm"], other["algorithm"]])
    for row, written in zip(rows, (base, other), strict=True):
        assert row == pytest.approx(written, abs=1e-4)
    assert (rows[0]["path_m_change"], rows[0]["path_m_change_pairs"]) == (None, 0)
    assert rows[1]["success_percent_change"] is not None
    assert wayfarer.compare(results)[0]["algorithm"] == "forest-pledge"
    own = [row._replace(algorithm=row.algorithm.replace("forest-pledge", "own")) for row in results.rows]
    without = wayfarer.Results(campaign_of(3, "own", "pledge"), own)
    assert wayfarer.compare(without)[0]["algorithm"] == "own", "the first one, as of the command"


def test_sweep_has_the_swept_values_in_each_row(tmp_path: Path) -> None:
    results = wayfarer.run_sweep(
        {"slip_mean_m": [5, np.float64(10.5)], "escape.turn_angle_deg": [30, 30]},
        "pledge", 1, budget_m=10.0, out=tmp_path / "out",
    )  # fmt: skip
    assert pd.read_csv(tmp_path / "out/trials.csv")["slip_mean_m"].tolist() == [5.0, 10.5]
    assert [list(row.values())[:3] for row in results.trials] == [[0, 5, 30], [1, 10.5, 30]]
    assert list(results.trials[0])[:3] == ["point", "slip_mean_m", "escape.turn_angle_deg"]
    assert [row["slip_mean_m"] for row in results.summary] == [5, 10.5]
    opened = wayfarer.open_results(tmp_path / "out")
    assert (opened.trials, opened.settings) == (results.trials, results.settings)
    with pytest.raises(wayfarer.WayfarerError, match="sweep"):
        wayfarer.compare(results)
    with pytest.raises(wayfarer.WayfarerError, match="key 'slip_mean_m' has no value"):
        wayfarer.run_sweep({"slip_mean_m": []})


def test_sweep_takes_site_slope_and_physics(tmp_path: Path) -> None:
    at_site = partial(wayfarer.run_sweep, {"escape.back_off_m": [0.15]}, trials=1, rover="minirover", budget_m=1.0)
    (row,) = at_site(site="extended-maze", set={"sim.slope_deg": (np.int64(2), 4.0)}, out=tmp_path / "out").trials
    assert row["interventions"] == 0
    assert 2.0 <= row["sim.slope_deg"] <= 4.0
    with pytest.raises(wayfarer.WayfarerError, match="ground mud is of physics-light"):
        at_site(ground="mud", physics="mujoco")
    with pytest.raises(wayfarer.WayfarerError, match=r"key 'sim\.friction' has an effect only in MuJoCo; add physics"):
        at_site(set={"sim.friction": 0.3})


NO_MOTORS = wayfarer.load_rover("sim").model_copy(update={"name": "mine", "parts": {}})
REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"algorithms": "pledg"}, "unknown algorithm 'pledg': did you mean pledge"),
    ({"trials": 0}, "trials = 0: input should be greater than or equal to 1"),
    ({"slip_mean_m": math.inf}, "slip_mean_m = inf: input should be a finite number"),
    ({"rover": "sims"}, "unknown rover 'sims': did you mean sim"),
    ({"site": "maze"}, "unknown site 'maze'"),
    ({"site": "extended-maze", "rover": "minirover", "forests": "reference"}, "site and forests do not go together"),
    ({"site": "extended-maze", "rover": "minirover", "go_on": True}, "go_on has no effect with site"),
    ({"ground": "ice"}, "ground = 'ice': input should be 'ideal'"),
    ({"forests": "no.jsonl"}, "no.jsonl"),
    ({"rover": NO_MOTORS, "depth": "bus"}, "mine: key 'parts.compass' is missing"),
    ({"set": {"anomaly_source": "sight"}}, "key 'anomaly_source' = 'sight': input should be one or more of 'motion', "),
    ({"trials": True}, "trials = True: input should be a valid integer"),
    ({"slip_mean_m": np.True_}, "slip_mean_m = True: input should be a valid number"),
    ({"set": {"sim.slope_deg": (15, 0)}}, "set sim.slope_deg = (15, 0): expected a value, or LOW:HIGH"),
    ({"set": {"ground": (1, 2)}}, "key 'ground' is not a number"),
    ({"slip_mean_m": 2, "set": {"slip_mean_m": 3}}, "slip_mean_m and the key 'slip_mean_m' set the same value"),
    ({"resume": True}, "name it with out"),
    ({"jobs": 0}, "jobs = 0: expected a number of processes, one at least"),
    ({"jobs": "2"}, "jobs = '2': expected"),
    ({"jobs": True}, "jobs = True: expected"),
    ({"out": 5}, "out = 5: expected the path of a folder"),
    ({"out": "a\0b"}, "expected the path of a folder"),
    ({"executor": 5, "out": "never"}, "no concurrent.futures.Executor"),
    ({"algorithms": 5}, "algorithms = 5: expected str | Sequence[str]"),
    ({"algorithms": b"pledge"}, "algorithms = b'pledge': expected str"),
    ({"site": ["maze"]}, "site = ['maze']: expected str"),
    ({"rover": 5}, "rover = 5: expected str | Path"),
    ({"forests": 5}, "forests = 5: expected str | Path"),
    ({"forests": "\0"}, "embedded null"),
    ({"faults": [5]}, "faults = [5]: expected Sequence[str]"),
    ({"set": 5}, "set = 5: expected Mapping"),
    ({"set": [("sim.slope_deg", 5)]}, "expected Mapping"),
    ({"set": {"sim.slope_deg": b"x"}}, "set sim.slope_deg = b'x': expected a value, or LOW:HIGH"),
    ({"set": {"sim.slope_deg": {1: 2, 3: 4}}}, "expected a value, or LOW:HIGH"),
    ({"set": {"sim.slope_deg": np.eye(2)}}, "expected a value, or LOW:HIGH"),
    ({"set": {"sim.slope_deg": np.True_}}, "key 'sim.slope_deg' = True: input should be a valid number"),
    ({"set": {"sim.slope_deg": Decimal("1e999")}}, "key 'sim.slope_deg' = inf: input should be a finite number"),
    ({"set": {"sim.slope_deg": (0, 10**400)}}, "both below 1e16"),
    ({"algorithms": "__main__:mine", "jobs": 2}, "put it in a separate file and name it"),
]


@pytest.mark.parametrize(("arguments", "said"), REFUSED, ids=lambda value: value if isinstance(value, str) else "")
def test_what_cannot_be_used_is_refused_in_a_line(
    arguments: dict[str, Any], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["__main__"], "mine", BUILT_IN["pledge"], raising=False)
    with pytest.raises(wayfarer.WayfarerError) as refusal:
        wayfarer.run_campaign(**arguments)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert not Path("never").exists(), "a folder that nothing was run into would have to be removed first"


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (5, "values = 5: expected a mapping"),
        ({"slip_mean_m": 5}, "values of 'slip_mean_m' = 5: expected a list"),
        ({"slip_mean_m": "25"}, "values of 'slip_mean_m' = '25': expected a list"),
        ({"slip_mean_m": [[1]]}, "expected a list of numbers"),
        ({"slip_mean_m": [None]}, "expected a list of numbers"),
        ({"name": ["a,b"]}, "'a,b' cannot be swept: a text in trials.csv has no comma"),
        ({"name": ["a\nb"]}, "cannot be swept"),
    ],
)
def test_values_that_cannot_be_swept_are_refused_in_a_line(values: Any, said: str) -> None:
    with pytest.raises(wayfarer.WayfarerError) as refusal:
        wayfarer.run_sweep(values, trials=1)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("slope", [Fraction(7, 2), Decimal("3.5"), np.float32(3.5), np.array(3.5), "3.5"], ids=str)
def test_every_kind_of_number_is_one(slope: Any) -> None:
    assert wayfarer.run_campaign(trials=1, budget_m=1, set={"sim.slope_deg": slope}).settings["set"] == {
        "sim.slope_deg": 3.5
    }


def test_folder_in_use_is_not_written_over_and_can_be_resumed(results: wayfarer.Results, out: Path) -> None:
    with pytest.raises(wayfarer.WayfarerError, match="is not empty"):
        short(out=out)
    assert short(out=out, resume=True).rows == results.rows


@pytest.mark.parametrize("call", [wayfarer.run_campaign, wayfarer.run_trial])
def test_trial_that_could_not_be_run_is_an_error_with_its_cause(call: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise KeyError("no such phase")

    monkeypatch.setattr("wayfarer.escape.handler.PhasedHandler.decide", broken)
    with pytest.raises(wayfarer.WayfarerError, match=r"trial 0 of forest-pledge could not be run: KeyError") as raised:
        call()
    assert isinstance(raised.value.__cause__, KeyError)


def test_any_executor_runs_the_trials(results: wayfarer.Results) -> None:
    with ThreadPoolExecutor(2) as threads:
        assert short(executor=threads, jobs=2).rows == results.rows


def interrupted(spec: TrialSpec) -> TrialResult:
    signal.raise_signal(signal.SIGINT)
    return quick(spec)


def test_ctrl_c_ends_a_campaign_whose_trials_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as broken, pytest.raises(KeyboardInterrupt):
        broken.setattr(runner, "run", partial(runner.run, run_trial=interrupted))
        wayfarer.run_campaign("pledge", trials=4, out=tmp_path / "out")
    with pytest.raises(wayfarer.WayfarerError, match="not finished"):
        wayfarer.open_results(tmp_path / "out")
    monkeypatch.setattr(runner, "run", partial(runner.run, run_trial=quick))
    assert len(wayfarer.run_campaign("pledge", trials=4, out=tmp_path / "out", resume=True).rows) == 4


@pytest.mark.process
def test_script_without_a_guard_runs_in_processes_inside_a_running_loop(tmp_path: Path) -> None:
    """As a cell of a notebook does: workers import nothing of the script, and its loop is not in the way."""
    script = tmp_path / "script.py"
    script.write_text(
        "import asyncio, wayfarer\n"
        "async def cell():\n"
        "    arguments = dict(algorithms='pledge', trials=2, budget_m=5.0)\n"
        "    one, two = (wayfarer.run_campaign(jobs=jobs, **arguments).rows for jobs in (1, 2))\n"
        "    alone = wayfarer.run_trial(1, 'pledge', budget_m=5.0).row\n"
        "    print(one == two, alone == one[1])\n"
        "asyncio.run(cell())\n",
        encoding="utf-8",
    )
    env = {**os.environ, "PYTHONPATH": str(Path(wayfarer.__file__).parents[1])}
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False, env=env)
    assert (done.stdout, done.stderr) == ("True True\n", "")
