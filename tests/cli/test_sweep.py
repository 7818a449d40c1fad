from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.experiments import fake_trials

ANGLES = "escape.turn_angle_deg=10,30"


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a sweep in this process, with trials that end at once."""
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", fake_trials.quick)
    return partial(run, "sweep")


def test_sweep_prints_a_line_a_point_and_fills_its_folder(run: Run, tmp_path: Path) -> None:
    code, out, err = run(ANGLES, "slip_mean_m=2:10:8", "--trials", 4, "--jobs", 1, "--out", tmp_path / "out")
    assert code == 0
    assert [line.split()[1:3] for line in out.splitlines() if "forest-pledge" in line] == [
        ["10", "2"], ["10", "10"], ["30", "2"], ["30", "10"],
    ]  # fmt: skip
    assert "wayfarer report" in err
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"sweep.json", "trials.csv", "trials.parquet"}


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["escape.turn_angel_deg=10"], "unknown key 'escape.turn_angel_deg': did you mean escape.turn_angle_deg"),
        (["escape.turn_angle_deg=10,190"], "key 'escape.turn_angle_deg' = 190: input should be less than or equal to"),
        (["escape.turn_angle_deg"], "write KEY=VALUES"),
        (["escape.turn_angle_deg=10:180"], "a range is FIRST:LAST:STEP"),
        ([ANGLES, "slip_mean_m=2", "footprint_m=0.4"], "3 keys to sweep"),
        ([ANGLES, ANGLES], "set the same value"),
        ([ANGLES, "--slip-mean-m", "nan"], "finite number above 0"),
        ([ANGLES, "--algorithm", "plegde"], "unknown algorithm 'plegde': did you mean pledge"),
        ([ANGLES, "--rover", "nobody"], "unknown rover 'nobody'"),
        ([], "Missing argument"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing_behind(
    run: Run, tmp_path: Path, arguments: list[str], told: str
) -> None:
    code, out, err = run(*arguments, "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert told in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_out_is_needed(run: Run) -> None:
    code, _, err = run(ANGLES)
    assert code == 2
    assert "--out" in err
