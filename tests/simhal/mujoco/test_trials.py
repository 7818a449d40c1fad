"""Whole trials in MuJoCo, through the command: the same bytes again, both depths, and what is refused in one line."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from tests.simhal.commands import facts_of, succeed
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.experiments.results import Results
from wayfarer.experiments.rows import COLUMNS
from wayfarer.experiments.trial import TrialResult, run_trial
from wayfarer.experiments.trial_setup import TrialSpec

SIM = ("sim", "--physics", "mujoco", "--jobs", "1", "--trials", "2", "--budget-m", "6")


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_same_seed_gives_the_same_bytes(run: Run, tmp_path: Path) -> None:
    drawn = ("--set", "sim.friction=0.2:0.6", "--set", "sim.roughness_m=0.005", "--set", "sim.torque_scale=1:3")
    for name in ("once", "again"):
        succeed(run, *SIM, *drawn, "--out", tmp_path / name, "--log-dir", tmp_path / f"{name}-log")
    assert (tmp_path / "once" / "trials.csv").read_bytes() == (tmp_path / "again" / "trials.csv").read_bytes()
    logs = files_in(tmp_path / "once-log")
    assert logs == files_in(tmp_path / "again-log")
    headers = [json.loads(log.splitlines()[0]) for log in logs.values()]
    assert len({header["mujoco"]["friction"] for header in headers}) == 2, "drawn for each trial"
    assert all(0.2 <= header["mujoco"]["friction"] <= 0.6 for header in headers)


@pytest.mark.parametrize("rover", ["sim", "forestrover"])
def test_both_depths_decide_the_same(run: Run, tmp_path: Path, rover: str) -> None:
    rows = []
    for depth in ("device", "bus"):
        succeed(run, *SIM, "--rover", rover, "--depth", depth, "--out", tmp_path / depth)
        rows.append((tmp_path / depth / "trials.csv").read_bytes())
    assert rows[0] == rows[1]
    assert b"fault" not in rows[0]


@pytest.mark.parametrize("scenario", ["extended-maze", "dense-obstruction", "forest-escape"])
def test_every_site_runs(run: Run, tmp_path: Path, scenario: str) -> None:
    succeed(run, *SIM, "--budget-m", "3", "--rover", "minirover", "--site", scenario, "--out", tmp_path / "out")
    assert b"fault" not in (tmp_path / "out" / "trials.csv").read_bytes()


def test_campaign_says_what_it_ran_on_and_can_be_rebuilt(run: Run, tmp_path: Path) -> None:
    run(*SIM, "--set", "sim.friction=0.2:0.6", "--out", tmp_path / "out")
    settings = json.loads((tmp_path / "out" / "campaign.json").read_text(encoding="utf-8"))
    assert (settings["physics"], settings["set"]) == ("mujoco", {"sim.friction": [0.2, 0.6]})
    succeed(run, *SIM, "--set", "sim.friction=0.2:0.6", "--out", tmp_path / "out", "--resume")
    results = Results.open(tmp_path / "out")
    assert results.rebuild().ranges == {"sim.friction": (0.2, 0.6)}
    assert facts_of(results)["sim.friction"] == "0.2 to 0.6, drawn for each trial"


def test_table_has_what_was_drawn_for_each_trial(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, ran = tmp_path / "out", []

    def counted(spec: TrialSpec, log_dir: Path | None = None) -> TrialResult:
        ran.append(spec.trial)
        return run_trial(spec, log_dir)

    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", counted)
    drawn = (*SIM, "--trials", "3", "--set", "sim.friction=0.2:0.6")
    succeed(run, *drawn, "--out", out)
    with (out / "trials.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [*COLUMNS, "sim.friction"]
    assert len({row["sim.friction"] for row in rows}) == 3
    assert all(0.2 <= float(row["sim.friction"]) <= 0.6 for row in rows)
    assert [row.drawn["sim.friction"] for row in Results.open(out).rows] == [float(row["sim.friction"]) for row in rows]

    ran.clear()
    assert_resumed_after_the_first_trial(run, drawn, out)
    assert ran == [1, 2]


def assert_resumed_after_the_first_trial(run: Run, command: tuple[str, ...], out: Path) -> Path:
    """A copy of the folder that lost all but its first trial is completed to the same table; return the copy."""
    complete = (out / "trials.csv").read_text(encoding="utf-8")
    header, first, *_ = complete.splitlines()
    (again := out.with_name("again")).mkdir()
    shutil.copy(out / "campaign.json", again)
    (again / "trials.csv").write_text(f"{header}\n{first}\n", encoding="utf-8")
    succeed(run, *command, "--out", again, "--resume")
    assert (again / "trials.csv").read_text(encoding="utf-8") == complete
    return again


@pytest.mark.long
def test_site_in_mujoco_tells_kinds_of_help_and_terrain_and_is_gone_on_with_and_drawn(run: Run, tmp_path: Path) -> None:
    clutter = ("--site", "dense-obstruction", "--rover", "forestrover")
    site = (*SIM, *clutter, "--budget-m", "3", "--set", "sim.friction=0.3:0.6")
    said = succeed(run, *site, "--out", tmp_path / "out")
    assert "0.0 (0.0/0.0)" in said
    rows = list(csv.DictReader((tmp_path / "out" / "trials.csv").read_text(encoding="utf-8").splitlines()))
    assert all(row[name] for row in rows for name in ("interventions", "overturned", "off_wheels", "sim.friction"))

    again = assert_resumed_after_the_first_trial(run, site, tmp_path / "out")
    succeed(run, "report", again, "--gallery", "2", "--jobs", "1")
    page = (again / "report.html").read_text(encoding="utf-8")
    assert "Not drawn" not in page
    assert page.count("It kept to ") == sum(row["outcome"] == "entrapped" for row in rows)


@pytest.mark.process
def test_light_campaign_loads_no_engine() -> None:
    code = (
        "import sys; from wayfarer import cli; cli.run(['sim', '--trials', '1', '--trial', '0', '--budget-m', '3']);"
        "print('mujoco' in sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.splitlines()[-1] == "False"


CHASSIS = {"ground_clearance_m": 0.04, "weight_kg": 6.0, "motors_n_m": 4.5, "height_m": 0.2, "wheel_radius_m": 0.05}


def rover_file(chassis: dict[str, float], width_m: float = 0.4) -> str:
    vehicle = f"[vehicle]\nlength_m = 0.4\nwidth_m = {width_m}\ntrack_m = 0.5\nmax_speed_m_s = 1.4\n"
    return (
        'name = "plain"\n' + vehicle + "[chassis]\n" + "".join(f"{key} = {value}\n" for key, value in chassis.items())
    )


UNBUILDABLE = {
    "no chassis": (rover_file({}), "rover 'plain' has no chassis.weight_kg, and --physics mujoco needs a body"),
    "a gap": (rover_file({"weight_kg": 6.0, "motors_n_m": 4.5}), "rover 'plain' has no chassis.wheel_radius_m"),
    "a diameter": (
        rover_file({**CHASSIS, "wheel_radius_m": 0.13}),
        "two wheels behind each other do not fit into vehicle.length_m = 0.4",
    ),
    "wheels that do not reach the ground": (
        rover_file({**CHASSIS, "wheel_radius_m": 0.019}),
        "below the wheels' diameter of 0.038",
    ),
    "a belly above its top": (rover_file({**CHASSIS, "height_m": 0.03}), "must be below chassis.height_m = 0.03"),
    "no room between the wheels": (rover_file(CHASSIS, width_m=0.1), "leaves no room between wheels"),
    "no weight": (rover_file({**CHASSIS, "weight_kg": 0.0}), "key 'chassis.weight_kg' = 0.0: "),
}


@pytest.mark.parametrize(("text", "says"), UNBUILDABLE.values(), ids=UNBUILDABLE)
def test_rover_without_a_body_that_can_be_built_is_one_line(run: Run, tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "plain.toml"
    file.write_text(text, encoding="utf-8")
    assert says in refusal(run, *SIM, "--rover", file)


def feather(monkeypatch: pytest.MonkeyPatch, weight_kg: float, motors_n_m: float) -> None:
    """Write a rover file, and let the rover of it have a weight that no rover file may say."""

    def light(name: str) -> RoverConfig:
        config = load_rover(name)
        chassis = replace(config.chassis, weight_kg=weight_kg, motors_n_m=motors_n_m)
        return config.model_copy(update={"chassis": chassis})

    Path("feather.toml").write_text(rover_file(CHASSIS), encoding="utf-8")
    monkeypatch.setattr("wayfarer.experiments.checks.load_rover", light)


def test_less_weight_than_the_engine_takes_is_one_line(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    feather(monkeypatch, 1e-15, 4.5)
    said = refusal(run, *SIM, "--rover", "feather.toml")
    assert "MuJoCo cannot build this rover (Error: mass and inertia" in said


def test_fault_of_the_engine_is_told_in_its_own_words_and_leaves_no_file(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    feather(monkeypatch, 1e-9, 1000.0)
    code, _, err = run("sim", "--physics", "mujoco", "--budget-m", "6", "--rover", "feather.toml", "--trial", "0")
    assert (code, err.count("\n")) == (1, 1)
    assert "Unstable: MuJoCo could not work out the motion up to " in err
    assert "The simulation is unstable." in err
    assert [path.name for path in tmp_path.iterdir()] == ["feather.toml"]


def test_missing_engine_is_one_line(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.extras.find_spec", lambda name: None if name == "mujoco" else object())
    assert "--physics mujoco needs mujoco, which is not installed: pip install 'wayfarer-rover[physics]'" in refusal(
        run, *SIM
    )
