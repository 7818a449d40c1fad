from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.experiments.tuning import settings_matter
from tests.views.page.outline import Outline
from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec

ASKED = (
    "--forests", "reference", "--rover", "forestrover", "--points", 32, "--trials", 40, "--jobs", 1,
    "--search", "escape.turn_angle_deg=10:90:log", "--confirm-trials", 24, "--confirm-mujoco", 2,
)  # fmt: skip


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run a search in this process, with trials that end at once."""
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", settings_matter.trial)
    return partial(run, "tune")


@pytest.mark.process  # MuJoCo's first import starts one
def test_tune_finds_confirms_and_writes_and_refuses_another_search(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code, said, err = run(*ASKED, "--out", out)
    assert code == 0
    assert "32 of 32 points" in err
    development, light, mujoco = (
        line.split() for line in map(str.strip, said.splitlines()) if line.startswith(("dev", "held out,"))
    )
    assert (development[-1], light[-1], mujoco[-2:]) == ("0", "gain", ["too", "few"])
    assert {path.name for path in out.iterdir()} == {
        "search.json", "search.csv", "runs.json", "development.jsonl", "held-out", "tuned.toml", "summary.json",
        "report.html", "study.journal",
    }  # fmt: skip
    tuned, text = load_rover(str(out / "tuned.toml")), (out / "tuned.toml").read_text(encoding="utf-8")
    assert tuned.escape.turn_angle_deg == pytest.approx(45.0, rel=0.1)
    assert "# held-out forests, physics light: SPL +" in text

    files = {name: (out / name).read_bytes() for name in ("search.csv", "summary.json", "tuned.toml")}
    search = out / "search.csv"
    search.write_bytes(b"".join(search.read_bytes().splitlines(keepends=True)[:200]) + b"0,torn")
    assert run(*ASKED, "--out", out, "--resume")[0] == 0
    assert {name: (out / name).read_bytes() for name in files} == files, "interrupted and resumed"

    text = (out / "report.html").read_text(encoding="utf-8")
    assert "development.jsonl, BLAKE2b" in text
    page = Outline(text)
    assert page.tags["figure"] == 3, "history, importance, front"
    assert page.tags["tr"] == (1 + 6) + (1 + 1) + (1 + 33)
    assert page.links == []

    code, _, err = run(*ASKED, "--out", out, "--resume", "--seed", 3)
    assert (code, err.count("\n")) == (2, 1)
    assert "belongs to another search: campaign.seed is 0 there and 3 here" in err
    code, _, err = run(*ASKED[:-6], "--search", "escape.turn_angle_deg=10:80:log", "--out", out, "--resume")
    assert (code, "space.1.high is 90.0 there and 80.0 here" in err) == (2, True)


def test_signal_in_the_last_trial_of_a_look_ends_the_search_and_the_first_fault_is_told(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def trial(spec: TrialSpec, log_dir: Path | None = None) -> TrialResult:
        if spec.trial in {3, 5}:
            raise KeyError("phase")
        if spec.trial == 7:
            os.kill(os.getpid(), signal.SIGINT)
        return settings_matter.trial(spec, log_dir)

    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", trial)
    code, _, err = run(*ASKED[:2], "--points", 8, "--trials", 8, "--jobs", 1, "--out", tmp_path / "out")
    assert code == 130
    assert "interrupted: 8 trials of the search" in err
    assert err.count("ended in a fault") == err.count("point 0, trial 3 ended in a fault: KeyError") == 1
