"""``wayfarer sim --site``: the paper's field trials, with its figures below ours."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from tests.conftest import Run
from wayfarer.fieldlog.reader import find_header

MAZE = ("sim", "--site", "extended-maze", "--rover", "forestrover", "--jobs", "1")


def test_trials_count_interventions_and_are_one_layout_each(run: Run, tmp_path: Path) -> None:
    code, _, _ = run(*MAZE, "--trials", "2", "--budget-m", "3", "--out", tmp_path / "out")
    assert code == 0
    with (tmp_path / "out" / "trials.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["forest"], row["noise"]) for row in rows] == [("0", "0"), ("1", "0")]
    kinds = [(int(row["interventions"]), int(row["overturned"]) + int(row["off_wheels"])) for row in rows]
    assert all(count == of_kinds >= 0 for count, of_kinds in kinds)
    settings = json.loads((tmp_path / "out" / "campaign.json").read_text(encoding="utf-8"))
    assert settings["site"] == "extended-maze"


def test_ordinary_campaign_counts_no_interventions(run: Run) -> None:
    _, out, _ = run("sim", "--trial", "0", "--budget-m", "1")
    header, row = (line.split(",") for line in out.splitlines())
    assert row[header.index("interventions")] == ""


def test_trial_ends_at_the_sites_time_limit(run: Run) -> None:
    code, out, _ = run(*MAZE, "--algorithm", "levy-walk", "--trial", "4")
    row = dict(zip(*(line.split(",") for line in out.splitlines()), strict=True))
    assert code == 0
    assert (row["outcome"], row["time_s"]) == ("entrapped", "300.000")


def test_challenge_logs_positions(run: Run, tmp_path: Path) -> None:
    challenge = ("sim", "--site", "forest-escape", "--rover", "minirover", "--budget-m", "4")
    code, _, _ = run(*challenge, "--trial", "0", "--log-dir", tmp_path / "log")
    assert code == 0
    header = find_header(tmp_path / "log")
    assert header is not None
    assert header.parts["position"] == "simulated receiver"
    records = [
        json.loads(line) for line in (tmp_path / "log" / "run.00001.jsonl").read_text(encoding="utf-8").splitlines()
    ]
    assert any("latitude_deg" in record for record in records)
