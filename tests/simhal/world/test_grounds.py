"""``--ground``, through the commands: what it keeps, compares, tells and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from tests.simhal.commands import facts_of, succeed
from wayfarer.experiments.results import Results
from wayfarer.simhal.world.physics import GroundName

SIM = ("sim", "--jobs", "1", "--trials", "1", "--budget-m", "5")
NO_CHASSIS = 'name = "plain"\n[vehicle]\nlength_m = 0.4\nwidth_m = 0.4\ntrack_m = 0.5\nmax_speed_m_s = 1.4\n'


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    """A rover without a chassis."""
    file = tmp_path / "plain.toml"
    file.write_text(NO_CHASSIS, encoding="utf-8")
    return file


def test_ground_is_kept_told_and_rebuilt(run: Run, tmp_path: Path) -> None:
    succeed(run, *SIM, "--ground", "mud", "--out", tmp_path / "out", "--log-dir", tmp_path / "log")
    assert json.loads((tmp_path / "out" / "campaign.json").read_text(encoding="utf-8"))["ground"] == "mud"
    results = Results.open(tmp_path / "out")
    assert results.rebuild().ground is GroundName.mud
    assert facts_of(results)["ground"] == "mud"
    (log,) = (path for path in (tmp_path / "log").rglob("*") if path.is_file())
    assert json.loads(log.read_text(encoding="utf-8").splitlines()[0])["ground"] == "mud"


@pytest.mark.parametrize(("there", "here"), [("ideal", "mud"), ("mud", "ideal")])
def test_folder_of_another_ground_is_not_resumed(run: Run, tmp_path: Path, there: str, here: str) -> None:
    run(*SIM, "--ground", there, "--out", tmp_path / "out")
    err = refusal(run, *SIM, "--ground", here, "--out", tmp_path / "out", "--resume")
    assert f"ground is '{there}' there and '{here}' here" in err
    succeed(run, *SIM, "--ground", there, "--out", tmp_path / "out", "--resume")


def test_grounds_can_be_swept(run: Run, tmp_path: Path) -> None:
    succeed(
        run, "sweep", "ground=ideal,mud", "--trials", "1", "--budget-m", "5", "--jobs", "1", "--out", tmp_path / "out"
    )
    settings = json.loads((tmp_path / "out" / "campaign.json").read_text(encoding="utf-8"))
    assert settings["axes"] == [{"key": "ground", "values": ["ideal", "mud"], "now": "ideal"}]
    ideal, mud = (tmp_path / "out" / "trials.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert (ideal.split(",")[:2], mud.split(",")[:2]) == (["0", "ideal"], ["1", "mud"])
    assert ideal.split(",")[2:] != mud.split(",")[2:]


def test_sweep_of_grounds_with_another_chassis_is_another_sweep(run: Run, tmp_path: Path) -> None:
    """Ideal ground reads nothing of the chassis; the other points do."""
    sweep = ("sweep", "ground=ideal,mud", "--trials", "1", "--budget-m", "5", "--jobs", "1", "--out", tmp_path / "out")
    run(*sweep)
    kept = tmp_path / "out" / "campaign.json"
    kept.write_text(kept.read_text(encoding="utf-8").replace('"weight_kg": 6.1', '"weight_kg": 7.1'), encoding="utf-8")
    assert "rover.chassis.weight_kg is 7.1 there and 6.1 here" in refusal(run, *sweep, "--resume")


@pytest.mark.parametrize("command", [(*SIM, "--ground", "mud"), ("sweep", "ground=ideal,mud", "--out", "never")])
def test_rover_without_a_body_is_one_line(run: Run, plain: Path, command: tuple[str, ...]) -> None:
    err = refusal(run, *command, "--rover", plain)
    assert "rover 'plain' has no chassis.weight_kg, and --ground mud needs a body with wheels" in err
    assert str(plain) in err
