"""``--fault``: trials with faults on purpose, in a campaign, one alone and on the live rover; and their list."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import wayfarer
from tests.conftest import Run, refusal
from wayfarer.cli.rover import simulated
from wayfarer.config.rover_file import load_rover
from wayfarer.errors import BadInput
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import FaultInjected

QUICK = ("sim", "--trials", 2, "--budget-m", 20, "--jobs", 1)
FAULT = ("--fault", "silent:compass@3+2")


def trials_of(folder: Path) -> bytes:
    return (folder / "trials.csv").read_bytes()


def test_campaign_has_its_faults_in_each_trial_and_is_resumed_with_the_same_only(tmp_path: Path, run: Run) -> None:
    well, struck = tmp_path / "well", tmp_path / "struck"
    assert run(*QUICK, "--out", well)[0] == 0
    assert run(*QUICK, *FAULT, "--fault", "snag@9+1", "--out", struck)[0] == 0
    assert trials_of(struck) != trials_of(well)
    settings = json.loads((struck / "campaign.json").read_text(encoding="utf-8"))
    assert settings["faults"] == ["silent:compass@3+2", "snag@9+1"]
    assert run(*QUICK, *FAULT, "--fault", "snag@9+1", "--out", struck, "--resume")[0] == 0
    assert "faults" in refusal(run, *QUICK, *FAULT, "--out", struck, "--resume")


@pytest.mark.process
def test_faults_are_the_same_in_several_processes_and_from_python(tmp_path: Path, run: Run) -> None:
    for jobs in (1, 2):
        assert run(*QUICK, "--jobs", jobs, *FAULT, "--out", tmp_path / str(jobs))[0] == 0
    assert trials_of(tmp_path / "1") == trials_of(tmp_path / "2")
    wayfarer.run_campaign(trials=2, budget_m=20.0, faults=[FAULT[1]], out=tmp_path / "api")
    assert trials_of(tmp_path / "api") == trials_of(tmp_path / "1")


@pytest.mark.parametrize("depth", ["device", "bus"])
def test_log_of_a_trial_tells_when_its_fault_began_and_ended(tmp_path: Path, run: Run, depth: str) -> None:
    log = tmp_path / "log"
    asked = ("sim", "--trial", 0, "--budget-m", 20, "--rover", "forestrover", "--depth", depth, *FAULT)
    assert run(*asked, "--log-dir", log)[0] == 0
    faults = [each for each in RunReader(log) if isinstance(each, FaultInjected)]
    assert [(each.t_s, each.target, each.kind, each.begins) for each in faults] == [
        (3.0, "compass", "silent", True),
        (5.0, "compass", "silent", False),
    ]
    said = run("logs", "show", log)[1]
    assert "a fault begins: compass silent for 2 s" in said
    assert "a fault ends: compass silent" in said


def test_trial_from_python_keeps_its_faults_in_its_log(tmp_path: Path) -> None:
    struck = wayfarer.run_trial(0, budget_m=20.0, faults=[FAULT[1]], log_dir=tmp_path / "log")
    assert struck.row != wayfarer.run_trial(0, budget_m=20.0).row
    faults = [each for each in RunReader(tmp_path / "log") if isinstance(each, FaultInjected)]
    assert [each.begins for each in faults] == [True, False]


@pytest.mark.parametrize("depth", ["device", "bus"])
@pytest.mark.parametrize("kind", ["silent", "task_crash"])
@pytest.mark.parametrize("part", ["compass", "motors"])
def test_fault_on_purpose_has_an_outcome_although_it_ends_the_run(depth: str, kind: str, part: str) -> None:
    """An error of the same kind that nobody asked for ends the campaign."""
    ended = wayfarer.run_trial(0, budget_m=2.0, rover="forestrover", depth=depth, faults=[f"{kind}:{part}@0"])
    assert ended.outcome == "fault"
    assert (ended.row.path_m, ended.row.spl) == (0.0, None)


def test_report_says_which_faults_were_on(tmp_path: Path, run: Run) -> None:
    assert run(*QUICK, *FAULT, "--out", tmp_path / "out")[0] == 0
    assert run("report", tmp_path / "out", "--gallery", 1)[0] == 0
    page = next((tmp_path / "out").glob("*.html")).read_text(encoding="utf-8")
    assert "compass silent for 2 s from 3 s on" in page


def test_list_has_each_kind_with_its_parts_and_what_it_does(run: Run) -> None:
    code, out, _ = run("list", "--faults", "--json")
    faults = {each["kind"]: each for each in json.loads(out)["faults"]}
    assert code == 0
    assert faults["silent"]["parts"] == ["compass", "motion", "contact", "wheels", "position", "motors"]
    assert (faults["nack"]["depth"], faults["snag"]["depth"]) == ("bus", None)
    assert faults["drive"]["params"] == {"left_gain": 0.0, "right_gain": 1.0}
    told = run("list", "--faults")[1]
    assert "The part does not answer." in told
    anywhere, _, in_virtual_time = told.partition("with wayfarer sim only")
    for kind, where in {"task_crash": anywhere, "loop_stall": in_virtual_time, "undervoltage": in_virtual_time}.items():
        assert f" {kind} " in where


def test_bug_in_a_driver_can_be_injected_into_the_live_rover_too() -> None:
    simulated(load_rover("sim"), "sim", "device", 0, ["task_crash:compass@1"])
    for of_the_process in ("loop_stall", "undervoltage"):
        with pytest.raises(BadInput, match="in virtual time only: use wayfarer sim"):
            simulated(load_rover("sim"), "sim", "device", 0, [of_the_process])
