from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.experiments import fake_trials
from wayfarer.experiments.results import Results
from wayfarer.experiments.trial import TrialResult
from wayfarer.reports.sweep import write_sweep_report

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
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"campaign.json", "runs.json", "trials.csv"}


def test_sweep_at_a_site_counts_time_and_interventions(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def helped(*arguments: object) -> TrialResult:
        result = fake_trials.quick(*arguments)  # type: ignore[arg-type]
        return result._replace(outcome="escaped", time_s=120.0, interventions=result.trial % 2)

    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", helped)
    at_site = ("--site", "dense-obstruction", "--rover", "forestrover", "--set", "sim.slope_deg=0:5")
    code, out, err = run(ANGLES, *at_site, "--trials", 4, "--jobs", 1, "--out", tmp_path / "out")
    assert code == 0, err
    assert [line.split()[-2:] for line in out.splitlines() if "forest-pledge" in line] == [["120.0", "0.50"]] * 2
    assert (tmp_path / "out" / "trials.csv").read_text().splitlines()[0].endswith(",sim.slope_deg")
    page = write_sweep_report(Results.open(tmp_path / "out")).read_text(encoding="utf-8")
    assert "dense-obstruction" in page
    assert "interventions" in page
