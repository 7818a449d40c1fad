"""``--senses``, through the commands: what it keeps, compares, tells and refuses."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.simhal.commands import facts_of, succeed
from wayfarer.errors import BadInput
from wayfarer.experiments.commands import senses
from wayfarer.experiments.report.load_results import read_results
from wayfarer.simhal.world.physics import FIELD, PHYSICS

SIM = ("sim", "--jobs", "1", "--trials", "1", "--budget-m", "5")
BLIND = (*SIM, "--senses", "blind_share=0.3,blind_quality=0.4")


def test_names_and_single_errors_can_be_listed_and_the_later_one_counts() -> None:
    assert senses("ideal") == PHYSICS
    assert senses("field") == replace(PHYSICS, **FIELD)
    assert senses("blind_share=0.3, blind_quality=0.4") == replace(PHYSICS, blind_share=0.3, blind_quality=0.4)
    assert senses("field,compass_lag_s=0") == replace(PHYSICS, **{**FIELD, "compass_lag_s": 0.0})
    assert senses("compass_lag_s=0,field") == replace(PHYSICS, **FIELD)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ("feild", "unknown name or KEY=VALUE of --senses 'feild': did you mean field"),
        ("blind_shar=0.3", "unknown name or KEY=VALUE of --senses 'blind_shar=': did you mean blind_share="),
        ("blind_share", "did you mean blind_share="),
        ("slip_mean_m=3", "unknown name or KEY=VALUE of --senses 'slip_mean_m='"),
        ("", "unknown name or KEY=VALUE of --senses ''"),
        ("blind_share=2", "--senses blind_share=2: key 'blind_share' = 2.0: .* allowed is 0 to 1"),
        ("blind_share=nan", "--senses blind_share=nan: key 'blind_share'"),
        ("blind_share=much", "--senses blind_share=much: 'much' is not a number"),
    ],
)
def test_what_is_no_sense_is_refused(asked: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        senses(asked)


def test_senses_are_kept_told_and_rebuilt(run: Run, tmp_path: Path) -> None:
    succeed(run, *BLIND, "--out", tmp_path / "out", "--log-dir", tmp_path / "log")
    kept = {"blind_share": 0.3, "blind_quality": 0.4}
    settings = json.loads((tmp_path / "out" / "campaign.json").read_text(encoding="utf-8"))
    assert settings["sim"] == asdict(PHYSICS) | kept
    results = read_results(tmp_path / "out")
    assert results.rebuild().physics == replace(PHYSICS, **kept)
    assert facts_of(results)["sim.blind_share"] == "0.3"
    (log,) = (path for path in (tmp_path / "log").rglob("*.jsonl"))
    assert json.loads(log.read_text(encoding="utf-8").splitlines()[0])["sim"] == kept


def test_sweep_has_the_senses_that_it_does_not_sweep(run: Run, tmp_path: Path) -> None:
    succeed(
        run, "sweep", "sim.blind_share=0,0.3", "--senses", "blind_quality=0.4", "--trials", "1", "--budget-m", "5",
        "--jobs", "1", "--out", tmp_path / "out",
    )  # fmt: skip
    settings = json.loads((tmp_path / "out" / "sweep.json").read_text(encoding="utf-8"))
    assert settings["axes"] == [{"key": "sim.blind_share", "values": [0, 0.3], "now": 0.0}]
    assert settings["campaign"]["sim"] == asdict(PHYSICS) | {"blind_quality": 0.4}
    seeing, blind = (tmp_path / "out" / "trials.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert seeing.split(",")[2:] != blind.split(",")[2:]
