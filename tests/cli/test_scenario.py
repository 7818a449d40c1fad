"""``wayfarer sim --scenario``: the paper's field trials, with its figures below ours."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import get_args

import pytest

from tests.conftest import Run
from tests.experiments import fake_trials
from wayfarer.cli.sim import Ground
from wayfarer.fieldlog.reader import read_header
from wayfarer.simhal.world.grounds import GroundName

MAZE = ("sim", "--scenario", "extended-maze", "--rover", "forestrover", "--jobs", "1")


REFUSED = {
    "forests as well": ((*MAZE, "--forests", "x.jsonl"), "leave out --forests, or --scenario"),
    "a rover of unknown clearance": (
        ("sim", "--scenario", "extended-maze"), "rover 'sim' gives no chassis.ground_clear"
    ),
    "the same in MuJoCo": (
        ("sim", "--scenario", "extended-maze", "--physics", "mujoco"), "rover 'sim' gives no chassis.ground_clear"
    ),
    "no such scenario": (("sim", "--scenario", "swamp"), "'extended-maze', 'dense-obstruction', 'forest-escape'"),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "says"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_run_is_one_line(run: Run, arguments: tuple[str, ...], says: str) -> None:
    code, out, err = run(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err


def test_papers_trials_stand_below_ours(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", fake_trials.quick)
    code, out, _ = run(*MAZE, "--trials", "2", "--algorithm", "forest-pledge,levy-walk,pledge")
    assert code == 0
    lines = [line.split() for line in out.splitlines() if line.split()]
    papers = [line for line in lines if line[0] == "paper"]
    assert papers == [
        ["paper", "10", "100.0", "0", "152.0", "±", "21.0", "11.0"],
        ["paper", "10", "10.0", "9", "141.0", "±", "0.0", "11.0"],
    ]
    assert "interventions" in out


def test_trials_count_interventions_and_are_one_layout_each(run: Run, tmp_path: Path) -> None:
    code, _, _ = run(*MAZE, "--trials", "2", "--budget-m", "3", "--out", tmp_path / "out")
    assert code == 0
    with (tmp_path / "out" / "trials.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["forest"], row["noise"]) for row in rows] == [("0", "0"), ("1", "0")]
    kinds = [(int(row["interventions"]), int(row["overturned"]) + int(row["off_wheels"])) for row in rows]
    assert all(count == of_kinds >= 0 for count, of_kinds in kinds)
    settings = json.loads((tmp_path / "out" / "campaign.json").read_text(encoding="utf-8"))
    assert settings["scenario"] == "extended-maze"


def test_ordinary_campaign_counts_no_interventions(run: Run) -> None:
    _, out, _ = run("sim", "--trials", "1", "--trial", "0", "--budget-m", "1")
    header, row = (line.split(",") for line in out.splitlines())
    assert row[header.index("interventions")] == ""


def test_trial_ends_at_the_sites_time_limit(run: Run) -> None:
    code, out, _ = run(*MAZE, "--algorithm", "levy-walk", "--trials", "200", "--trial", "0")
    row = dict(zip(*(line.split(",") for line in out.splitlines()), strict=True))
    assert code == 0
    assert row["outcome"] == "escaped" or row["time_s"] == "300.000"
    assert float(row["time_s"]) <= 300.0


def test_challenge_logs_positions(run: Run, tmp_path: Path) -> None:
    challenge = ("sim", "--scenario", "forest-escape", "--rover", "minirover", "--budget-m", "4", "--trials", "1")
    code, _, _ = run(*challenge, "--trial", "0", "--log", tmp_path / "log")
    assert code == 0
    header = read_header(tmp_path / "log")
    assert header["parts"]["position"] == "simulated receiver"
    records = [json.loads(line) for line in (tmp_path / "log" / "run.jsonl").read_text(encoding="utf-8").splitlines()]
    assert any("latitude_deg" in record for record in records)


def test_command_knows_the_grounds_of_the_simulator() -> None:
    assert get_args(Ground) == tuple(GroundName)
