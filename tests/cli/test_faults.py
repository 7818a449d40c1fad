"""``wayfarer faults``: exit codes, what is printed, what is kept, and that its page tells the truth."""

from __future__ import annotations

import csv
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.children import child
from tests.conftest import Run, refusal
from tests.fault_scenarios import kinds_page
from tests.system.hil_setup import wait_for
from wayfarer import cli
from wayfarer.fault_scenarios.catalogue import covered_by_tests
from wayfarer.fault_scenarios.runner import RunResult, run_scenario
from wayfarer.fault_scenarios.scenario import Scenario
from wayfarer.fieldlog.reader import RunReader

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "faults.md").read_text(encoding="utf-8")
LOOSE = """\
[[scenario]]
name = "loose-plug"
clearing = true
for_s = 5.0
fault = [{ at_s = 3.0, for_s = 1.0, target = "compass", kind = "nack" }]
expect = { level = "S2", within_s = 0.4, causes = ["compass_stale"] }
[scenario.settings.safety]
start_delay_s = 0.5
"""


@pytest.fixture
def loose(tmp_path: Path) -> str:
    return scenario_file(tmp_path, LOOSE)


def scenario_file(folder: Path, text: str) -> str:
    path = folder / "faults.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_scenario_that_is_met_exits_0(loose: str, run: Run) -> None:
    code, out, _ = run("faults", "--scenario", loose)
    assert code == 0
    assert out.splitlines() == [
        "1 of 1 scenarios as expected: 1 in virtual time",
        "-v prints each scenario, remarks, and what is skipped and why",
    ]


def test_scenario_with_a_wrong_bound_exits_1_and_says_why(tmp_path: Path, run: Run) -> None:
    path = scenario_file(tmp_path, LOOSE.replace("within_s = 0.4", "within_s = 0.1"))
    code, out, _ = run("faults", "--scenario", path)
    assert code == 1
    assert re.search(r"loose-plug: detected after 0\.\d\d s, 0\.1 s are allowed", out)
    assert "FAILED" in out
    assert "0 of 1 scenarios as expected: 1 in virtual time" in out.splitlines()


@pytest.mark.process
def test_several_processes_give_what_one_gives(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, LOOSE + LOOSE.replace("loose-plug", "another").replace("compass", "motion", 1))
    for jobs in ("1", "2"):
        cli.run(["faults", "--scenario", path, "--jobs", jobs, "--out", str(tmp_path / jobs)])
    files = [sorted((tmp_path / jobs).rglob("*.*")) for jobs in ("1", "2")]
    assert len(files[0]) == 4
    for one, other in zip(*files, strict=True):
        assert one.read_bytes() == other.read_bytes()


@pytest.mark.process
def test_several_processes_give_the_missions_that_one_gives(tmp_path: Path) -> None:
    asked = ["faults", "--missions", "2", "--only", "motion-silent", "--rover", "sim"]
    for jobs in ("1", "2"):
        assert cli.run([*asked, "--jobs", jobs, "--out", str(tmp_path / jobs)]) == 0
    for name in ("results.csv", "results.json"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()


def test_results_and_logs_are_kept_and_logs_replay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, path = tmp_path / "out", scenario_file(tmp_path, LOOSE.replace("clearing", "about = '=1+1'\nclearing", 1))
    assert cli.run(["faults", "--scenario", path, "--out", str(out)]) == 0
    (row,) = csv.DictReader((out / "results.csv").read_text(encoding="utf-8").splitlines())
    (same,) = json.loads((out / "results.json").read_text(encoding="utf-8"))
    assert (row["name"], row["reached"], row["passed"]) == ("loose-plug", "S2", "True")
    assert (same["name"], same["reached"], same["passed"]) == ("loose-plug", "S2", True)
    assert (row["about"], same["about"]) == ("'=1+1", "=1+1"), "no formula to a spreadsheet"
    run = out / "loose-plug"
    faults = [record for record in RunReader(run) if record["record"] == "fault"]
    assert [(each["t_s"], each["target"], each["kind"], each["begins"]) for each in faults] == [
        (3.0, "compass", "nack", True),
        (4.0, "compass", "nack", False),
    ]
    capsys.readouterr()
    assert cli.run(["replay", str(run)]) == 0
    assert cli.run(["logs", "check", str(run)]) == 0
    assert cli.run(["logs", "show", str(run)]) == 0
    said = capsys.readouterr().out
    assert "a fault begins: compass nack for 1 s" in said
    assert "a fault ends: compass nack" in said


def test_folder_that_is_not_empty_is_refused(tmp_path: Path, loose: str, run: Run) -> None:
    code, _, err = run("faults", "--scenario", loose, "--out", tmp_path)
    assert code == 2
    assert "needs a new or empty folder" in err


def test_another_rover_runs_what_it_can_have(loose: str, run: Run) -> None:
    code, out, _ = run("faults", "--scenario", loose, "--rover", "minirover")
    assert code == 0
    assert "1 of 1 scenarios" in out


@pytest.fixture
def no_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the README's installation leaves out: None is what Python takes for "not installed"."""
    monkeypatch.setitem(sys.modules, "cv2", None)


@pytest.mark.usefixtures("no_opencv")
def test_without_a_package_its_scenarios_are_skipped_and_fail_nothing(tmp_path: Path, run: Run) -> None:
    path = scenario_file(tmp_path, LOOSE + LOOSE.replace('"loose-plug"', '"by-camera"\nrover = "minirover"'))
    out = tmp_path / "out"
    code, said, err = run("faults", "--scenario", path, "--jobs", "1", "--out", out, "-v")
    assert code == 0
    assert err.splitlines()[0] == (
        "1 scenario skipped: rover 'minirover' needs cv2 for [parts.motion], which is not installed: "
        "pip install 'wayfarer-rover[camera]'"
    )
    assert re.search(r"^ +by-camera .*skipped", said, re.MULTILINE)
    assert "\nSkipped\n  by-camera: rover 'minirover' needs cv2" in said
    assert said.splitlines()[-1] == "1 of 1 scenarios as expected: 1 in virtual time; 1 skipped"
    kept = json.loads((out / "results.json").read_text(encoding="utf-8"))
    assert [(row["name"], row["passed"], row["skipped"][:20]) for row in kept] == [
        ("loose-plug", True, ""),
        ("by-camera", False, "rover 'minirover' ne"),
    ]


@pytest.mark.usefixtures("no_opencv")
@pytest.mark.parametrize(
    ("options", "instead"),
    [
        (["faults", "--only", "camera-black,camera-gone"], ""),
        (["sim", "--rover", "minirover", "--depth", "bus"], "; or use --depth device"),
        (["sweep", "footprint_m=0.2", "--rover", "minirover", "--depth", "bus", "--out", "out"], "; or use --depth"),
        (["run", "--sim", "--rover", "minirover", "--depth", "bus"], "; or use --depth device"),
    ],
    ids=lambda value: " ".join(value[:3]) if isinstance(value, list) else "",
)
def test_what_nothing_can_be_run_of_says_what_to_install(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], instead: str
) -> None:
    monkeypatch.chdir(tmp_path)
    needs = (
        "rover 'minirover' needs cv2 for [parts.motion], which is not installed: pip install 'wayfarer-rover[camera]'"
    )
    assert f"{needs}{instead}" in refusal(run, *options)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("no_opencv")
def test_what_needs_no_camera_runs_without_opencv(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["sim", "--rover", "minirover", "--trial", "0", "--budget-m", "1"]) == 0


def test_list_shows_names_and_runs_nothing(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.fault_scenarios.command.run_scenario", lambda *_: pytest.fail("a scenario was run"))
    code, out, _ = run("faults", "--list")
    assert code == 0
    assert "board-fault" in out


@pytest.mark.parametrize("asked", ["35", "sigkill"])
def test_row_that_a_test_holds_names_the_test(asked: str, run: Run) -> None:
    code, out, err = run("faults", "--only", asked)
    assert code == 2
    assert out == ""
    test = covered_by_tests()["sigkill"].test
    assert err == f"wayfarer: sigkill: covered by a test in wayfarer's checkout: pytest -m '' {test}\n"


def test_row_of_a_scenario_and_a_test_runs_the_one_and_names_the_other(run: Run) -> None:
    code, out, _ = run("faults", "--only", "task-crash,algorithm-raises", "-v")
    assert code == 0
    assert covered_by_tests()["algorithm-raises"].test in out.split(), "whole, to be pasted"
    assert out.splitlines()[-2:] == [
        "1 of 1 scenarios as expected: 1 in virtual time; 1 skipped",
        "0 of 1 rows of the catalogue as expected; 1 not fully tested",
    ]


def test_an_error_inside_one_scenario_does_not_hide_the_others(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails_once(scenario: Scenario, log_dir: Path | None) -> RunResult:
        if scenario.name == "broken":
            raise ZeroDivisionError("by zero")
        return run_scenario(scenario, log_dir)

    monkeypatch.setattr("wayfarer.fault_scenarios.command.run_scenario", fails_once)
    path = scenario_file(tmp_path, LOOSE.replace("loose-plug", "broken") + LOOSE)
    code, out, _ = run("faults", "--scenario", path, "--jobs", "1")
    assert code == 1
    assert "broken: an error inside wayfarer: ZeroDivisionError('by zero')" in out
    assert "1 of 2 scenarios as expected" in out


@pytest.mark.process
def test_ctrl_c_ends_it_with_130(tmp_path: Path) -> None:
    many = "".join(
        LOOSE.replace("loose-plug", f"loose-{number}").replace("for_s = 5.0", "for_s = 600.0", 1)
        for number in range(30)
    )
    command = [sys.executable, "-c", "from wayfarer.cli import main; main()", "faults", "--scenario"]
    told = tmp_path / "stderr.txt"
    with (
        told.open("w") as stderr,
        child([*command, scenario_file(tmp_path, many)], stdout=subprocess.PIPE, stderr=stderr) as running,
    ):
        wait_for("the first scenarios are done", lambda: "scenarios" in told.read_text(), patience_s=60.0)
        running.send_signal(signal.SIGINT)
        out, _ = running.communicate(timeout=30.0)
    assert (running.returncode, out) == (130, b"")
    assert told.read_text().splitlines()[-1] == "interrupted: no results"


def test_missions_are_counted_and_kept_as_the_trials_of_a_seed(tmp_path: Path, run: Run) -> None:
    asked = ("faults", "--missions", 1, "--only", "motion-silent,flipped", "--rover", "sim", "--jobs", 1)
    code, said, _ = run(*asked, "--seed", 3, "--out", tmp_path / "out")
    assert code == 0
    assert re.search(r"^ +13 +flipped +1 +0 .* fault: overturned 1$", said, re.MULTILINE)
    assert re.search(r"^ +22 +motion-silent +10 +1 +1 +[0-9.]+ +[0-9.]+ +motion_stale", said, re.MULTILINE)
    assert "1 of 2 faults that last end a mission" in said
    kept = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    rows = list(csv.DictReader((tmp_path / "out" / "results.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["fault"] for row in kept] == ["flipped", "flipped", "motion-silent", "motion-silent"]
    assert [(row["lasts_s"], row["ended"]) for row in rows[:2]] == [
        ("", "fault: overturned 1"),
        ("10.0", "fault: overturned 1"),
    ]
    assert run(*asked, "--seed", 4)[1] != said


# -- docs/reference/faults.md ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layer", [*kinds_page.LAYERS, "reading"])
def test_page_has_every_kind_with_its_parameters(layer: str) -> None:
    section = PAGE.partition(f"### `{layer}`\n")[2].partition("\n#")[0]
    listed = [line for line in section.splitlines() if line.startswith("| `")]
    assert listed == kinds_page.rows(layer)


def test_page_names_the_test_of_every_fault_that_a_test_holds() -> None:
    section = PAGE.partition("## Faults covered by tests\n")[2].partition("\n#")[0]
    assert kinds_page.HELD_HEAD in section
    assert [line for line in section.splitlines() if line.startswith("| ") and "`" in line] == kinds_page.held()


@pytest.mark.long
def test_pages_scenario_runs_and_prints_what_the_page_shows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    path = tmp_path / "my-faults.toml"
    path.write_text(PAGE.partition("```toml\n")[2].partition("```")[0], encoding="utf-8")
    assert cli.run(["faults", "--scenario", str(path), "--jobs", "1", "-v"]) == 0
    shown = PAGE.partition("$ wayfarer faults --scenario my-faults.toml -v --out res\n")[2].partition("\n```")[0]
    assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == shown.splitlines()
