from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from tests.experiments import fake_trials
from wayfarer.cli import version_text
from wayfarer.errors import BadReading, MissingPart
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.sink import Sink

CHECKOUT = Path(__file__).resolve().parents[2]
SAMPLE = ["1", "--log-dir", str(CHECKOUT / "field_logs")]

FOREST = {
    "forest": 0, "noise": 1, "start_m": [25.0, 12.5], "heading_deg": 0.0, "goal_y_m": 50.0,
    "trunk_diameter_m": 0.3, "tree_radius_m": 0.25, "trunks_m": [],
    "trees_m": [[10.0, 10.0]], "shortest_path_m": 37.5,
}  # fmt: skip


# --- what every command promises


@pytest.mark.process
def test_version_imports_nothing_heavy() -> None:
    script = (
        "import sys; from wayfarer.cli import run; code = run(['--version']);"
        "heavy = {'numpy', 'scipy', 'pydantic', 'rich', 'asyncio', 'structlog', 'wayfarer.simhal'};"
        "print(code, sorted(heavy & set(sys.modules)))"
    )
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert told.stdout == f"{version_text()}\n0 []\n"


def test_no_arguments_show_the_help_and_no_error_line(run: Run) -> None:
    _, out, err = run()
    assert "Usage: wayfarer" in out
    assert "wayfarer:" not in err


@pytest.mark.parametrize(("error", "code"), [(MissingPart("no contact"), 2), (BadReading("no\nsense"), 1)])
def test_error_raised_on_purpose_is_one_line(
    run: Run, monkeypatch: pytest.MonkeyPatch, error: Exception, code: int
) -> None:
    def fail(name: str) -> None:
        raise error

    monkeypatch.setattr("wayfarer.experiments.checks.load_rover", fail)
    text = str(error).replace("\n", " ")
    assert run("sim") == (code, "", f"wayfarer: {text}\n")


def test_error_that_quotes_what_a_terminal_obeys_has_it_written_out(run: Run) -> None:
    code, _, said = run("sim", "--algorithm", "\x1b[2Jpledge")
    assert code == 2
    assert "\\x1b[2Jpledge" in said
    assert said.rstrip("\n").isprintable()


GET = "which is not installed: pip install 'wayfarer-rover"


@pytest.mark.parametrize(
    ("arguments", "module", "said"),
    [
        (["sim", "--trials", "1"], "numpy", f"simulating needs numpy, {GET}[sim]'"),
        (["sim", "--cluster", "x:1"], "distributed", f"distributed, {GET}[cluster]'"),
        (["run", "--sim"], "numpy", f"simulating needs numpy, {GET}[sim]'"),
        (["sim", "--spl"], "skfmm", f"--spl needs scikit-fmm, {GET}[spl]'"),
        (["sweep", "footprint_m=0.4", "--out", "o", "--spl"], "skfmm", f"{GET}[spl]'"),
        (["sim", "--site", "extended-maze"], "scipy", f"--site needs scipy, {GET}[sim]'"),
        (["report"], "bokeh", f"a report needs bokeh, {GET}[sim]'"),
        (["report", "r", "--figure", "f.pdf"], "matplotlib", "--figure needs matplotlib, which is not installed: pip"),
        (["run", "--sim", "--live"], "aiohttp", f"page needs aiohttp, {GET}[live]'"),
        (["demo"], "aiohttp", f"the live page needs aiohttp, {GET}[live]'"),
        (["logs", "export", *SAMPLE, "--out", "o.gpx"], "gpxpy", "gpx needs gpxpy, which is not installed"),
        (["logs", "export", *SAMPLE, "--out", "o.mcap"], "foxglove", f"mcap needs foxglove-sdk, {GET}[export]'"),
        (["run", "--sim", "--mavlink", "udpin:::1"], "pymavlink", f"--mavlink needs pymavlink, {GET}[mavlink"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_missing_extra_says_how_to_get_it(
    run: Run, monkeypatch: pytest.MonkeyPatch, arguments: list[str], module: str, said: str
) -> None:
    monkeypatch.setattr("wayfarer.extras.find_spec", lambda name: None if name == module else object())
    assert said in refusal(run, *arguments)


@pytest.mark.process
@pytest.mark.parametrize("arguments", [["list"], ["logs", "list", "--log-dir", "field_logs"]], ids=" ".join)
def test_nobody_who_reads_is_no_error(arguments: list[str]) -> None:
    command = f"{sys.executable} -c 'from wayfarer.cli import main; main()' {' '.join(arguments)} >&-"
    done = subprocess.run(["/bin/sh", "-c", command], capture_output=True, text=True, check=False, cwd=CHECKOUT)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.process
def test_letters_that_the_terminal_does_not_know_are_written_out(tmp_path: Path) -> None:
    log = FieldLog(Sink(tmp_path), {}, wall=lambda t_s: t_s)
    log.event("mark", 1.0, text="Mark: Bäume")
    log.close("requested", "enough")
    command = [sys.executable, "-c", "from wayfarer.cli import main; main()", "logs", "show", str(tmp_path)]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONIOENCODING": "ascii"}
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "Mark: B\\xe4ume" in done.stdout


# --- list


def test_list_names_algorithms_rovers_and_their_needs(run: Run) -> None:
    code, out, _ = run("list")
    assert code == 0
    assert [line.split()[:2] for line in out.splitlines() if " pledge " in line][:2] == [
        ["pledge", "pledge"],
        ["forest-pledge", "pledge"],
    ]
    assert "contact" in next(line for line in out.splitlines() if "oo-react" in line)
    assert "sim" in next(line for line in out.splitlines() if line.startswith("rovers:"))


def test_list_says_where_third_party_algorithms_come_from_and_survives_broken_ones(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    group = "wayfarer.algorithms"
    points = [
        EntryPoint("spiral", "tests.fake_plugins:spiral", group),
        EntryPoint("broken", "no_such_module:x", group),
    ]
    monkeypatch.setattr("wayfarer.config.registry.entry_points", lambda group: points if "algorithms" in group else [])
    code, out, _ = run("list")
    assert code == 0
    assert "(from tests.fake_plugins:spiral)" in " ".join(out.split())
    assert "cannot be loaded" in out


@pytest.mark.usefixtures("quick_trials")
@pytest.mark.parametrize("option", [("--trials", "2", "--out"), ("--trial", "0", "--log-dir")])
def test_folder_that_cannot_be_used_is_found_out_before_any_trial(
    run: Run, tmp_path: Path, option: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", lambda *_: pytest.fail("a trial was run"))
    (tmp_path / "file").touch()
    for folder in (tmp_path, tmp_path / "file", tmp_path / "file" / "below", Path("/proc/wayfarer")):
        said = refusal(run, "sim", "--jobs", 1, *option, folder)
        assert said.startswith(f"wayfarer: {folder} ")


# --- campaigns


@pytest.mark.usefixtures("quick_trials")
def test_paper_stands_for_its_ten_and_a_name_twice_runs_once(run: Run) -> None:
    code, out, _ = run("sim", "--trials", 2, "--jobs", 1, "--algorithm", "oo-react,paper,pledge")
    names = [line.split()[0] for line in out.splitlines() if line.startswith(" ") and "[" in line and "]" in line]
    assert code == 0
    assert names[1:] == [
        "oo-react", "pledge", "forest-pledge", "rand-pledge", "cv-pledge", "oo-pledge", "levy-pledge",
        "levy-walk", "cv-levy", "cv-react",
    ]  # fmt: skip


@pytest.mark.usefixtures("quick_trials")
def test_settings_reach_every_trial(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    specs: list[TrialSpec] = []

    def remembering(spec: TrialSpec, log_dir: Path | None = None) -> TrialResult:
        specs.append(spec)
        return fake_trials.quick(spec)

    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", remembering)
    forests = tmp_path / "forests.jsonl"
    forests.write_text(json.dumps(FOREST))
    options = ["--slip-mean-m", 2, "--budget-m", 50, "--set", "anomaly_source=contact", "--forests", forests]
    assert run("sim", "--trials", 3, "--jobs", 1, "--algorithm", "pledge", *options)[0] == 0
    assert [(spec.trial, spec.forest.noise) for spec in specs] == [(0, 1), (1, 2), (2, 3)]
    assert {(spec.algorithm, spec.physics.slip_mean_m, spec.budget_m) for spec in specs} == {("pledge", 2.0, 50.0)}
    assert {spec.rover.anomaly_source for spec in specs} == {"contact"}


@pytest.mark.usefixtures("quick_trials")
def test_progress_goes_to_stderr_in_plain_lines_and_the_table_to_stdout(run: Run, tmp_path: Path) -> None:
    code, out, err = run("sim", "--trials", 40, "--jobs", 1, "--out", tmp_path / "out")
    assert code == 0
    assert err.splitlines() == [
        *(f"{n} of 40 trials" for n in range(4, 41, 4)), f"the results are in {tmp_path / 'out'}",
        f"Next: wayfarer report {tmp_path / 'out'}",
    ]  # fmt: skip
    assert "forest-pledge" in out
    assert [line.split()[1:] for line in out.splitlines() if "paper  " in line] == [["99.7", "81.3", "29.3"]]


def test_trial_that_could_not_be_run_ends_the_campaign_in_one_line(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", fake_trials.third_fails)
    code, out, err = run("sim", "--trials", 5, "--jobs", 1, "--out", tmp_path / "out")
    assert (code, out) == (1, "")
    said = r"wayfarer: trial 3 of forest-pledge could not be run: KeyError: 'no such\\nphase' \(fake_trials.py:\d+\); "
    assert re.fullmatch(said + ".*--resume: 3 of 5 trials are kept in .*", err.splitlines()[-1])
    code, out, err = run("sim", "--trial", 3)
    assert (code, out) == (1, "")
    assert re.fullmatch(said + "correct that and run it again; with --log-dir DIR .*\n", err)
    code, out, err = run("sim", "--trial", 3, "--log-dir", tmp_path / "log")
    assert (code, out) == (1, "")
    assert re.fullmatch(said + f"correct that; its log and the traceback are in {tmp_path / 'log'}\n", err)
    assert "third_fails" in (tmp_path / "log" / "traceback.txt").read_text()


@pytest.mark.process
def test_real_trials_are_the_same_alone_and_on_any_number_of_workers(run: Run, tmp_path: Path) -> None:
    command = ("sim", "--budget-m", 15, "--algorithm", "forest-pledge")
    assert run(*command, "--trials", 4, "--jobs", 1, "--out", tmp_path / "1")[0] == 0
    assert run(*command, "--trials", 4, "--jobs", 2, "--out", tmp_path / "2")[0] == 0
    trials = (tmp_path / "1" / "trials.csv").read_text()
    assert (tmp_path / "2" / "trials.csv").read_text() == trials
    header, *rows = trials.splitlines()
    assert len(rows) == 4
    assert run(*command, "--trial", 2) == (0, f"{header}\n{rows[2]}\n", "")
    assert "fault" not in trials
