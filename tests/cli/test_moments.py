"""A moment of a run has one number, ``elapsed_s``, whichever tool names it."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
from pathlib import Path

import pytest

from tests.export.readers import read
from tests.logview.records import SAMPLE_LOGS, line
from wayfarer import cli

(SAMPLE,) = SAMPLE_LOGS.glob("0*")


@pytest.fixture
def changed(tmp_path: Path) -> tuple[Path, int]:
    """A run whose clock began long before it, with one decision changed: its folder and the number of that tick."""
    run = shutil.copytree(SAMPLE, tmp_path / SAMPLE.name)
    records = [json.loads(each) for each in (run / "run.00001.jsonl").read_bytes().splitlines()]
    tick = [each for each in records if each["record"] == "tick"][50]
    tick["phase"] = "else"
    (run / "run.00001.jsonl").write_bytes(b"".join(map(line, records)))
    return run, tick["n"]


def test_replay_show_and_exports_name_the_same_number(
    changed: tuple[Path, int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, n = changed
    assert cli.run(["replay", str(run)]) == 1
    said = re.search(r"then at (\S+) \(elapsed_s (\S+)\), n (\d+), phase was else", capsys.readouterr().out)
    assert said is not None
    shown, elapsed_s = said[1], float(said[2])
    assert int(said[3]) == n

    assert cli.run(["logs", "export", str(run), "--out", "-"]) == 0
    (row,) = (row for row in csv.DictReader(io.StringIO(capsys.readouterr().out)) if row["n"] == str(n))
    assert float(row["elapsed_s"]) == pytest.approx(elapsed_s, abs=0.0005)
    assert float(row["t_s"]) > 1000.0

    assert cli.run(["logs", "show", str(run), "--ticks"]) == 0
    (told,) = (each for each in capsys.readouterr().out.splitlines() if re.search(r"\belse\b", each))
    assert told.split()[0] == shown

    out = tmp_path / "run.mcap"
    assert cli.run(["logs", "export", str(run), "--out", str(out)]) == 0
    (time,) = (message.value for message in read(out).messages["/time"] if message.value["n"] == n)
    assert time["elapsed_s"] == float(row["elapsed_s"])


def test_replay_names_a_run_that_is_given_as_the_current_folder(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(SAMPLE)
    assert cli.run(["replay", "."]) == 0
    assert capsys.readouterr().out.startswith(f"{SAMPLE.name}: ")
