"""The word ``reference``: the forests that come with wayfarer are the ones that the tables were measured in."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.experiments import fake_trials
from tests.simhal.commands import succeed
from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.results import Results
from wayfarer.simhal.world.forest_file import REFERENCE, content_of, read_forest_file

CHECKSUM = "1937f0543ac287bc3ea0acac1dfacc14"  # BLAKE2b of the file that the tables of the README were measured with
ONE_TRIAL = ("--trial", 500, "--budget-m", 15)


@pytest.fixture
def quick_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", fake_trials.quick)


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to be in, whose own file ``reference`` has another forest than ours."""
    monkeypatch.chdir(tmp_path)
    row = json.loads(content_of(REFERENCE).split(b"\n")[6])
    (tmp_path / "reference").write_text(json.dumps(row | {"forest": 1234}))
    return tmp_path


def test_content_is_the_file_of_the_tables() -> None:
    file = read_forest_file(REFERENCE)
    assert (file.name, file.blake2b, len(file.forests)) == ("reference", CHECKSUM, 500)


def test_forests_are_250_layouts_with_two_noises_in_file_order() -> None:
    pairs = [(forest.forest, forest.noise) for forest in read_forest_file(REFERENCE).forests]
    assert pairs == [(n // 2, 2025 + n % 2) for n in range(500)]


def test_trial_beyond_the_last_begins_again_with_another_noise() -> None:
    campaign = Campaign(("pledge",), 501, load_rover("sim"), forests=read_forest_file(REFERENCE))
    assert [campaign.forest_and_noise(n) for n in (0, 1, 500)] == [(0, 2025), (0, 2026), (0, 2027)]
    assert campaign.make_forest(500).trunks == campaign.make_forest(0).trunks


def test_word_gives_the_same_row_as_the_file(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "forests.jsonl"
    file.write_bytes(content_of(REFERENCE))
    code, by_word, _ = run("sim", "--forests", "reference", *ONE_TRIAL)
    assert code == 0
    assert by_word.splitlines()[1].startswith("500,forest-pledge,0,2027,")
    assert run("sim", "--forests", file, *ONE_TRIAL) == (0, by_word, "")


@pytest.mark.usefixtures("elsewhere", "quick_trials")
def test_file_of_that_name_is_reached_with_its_folder(run: Run) -> None:
    rows = [run("sim", "--forests", source, "--trial", 0)[1].splitlines()[1] for source in ("reference", "./reference")]
    assert [row.split(",")[2] for row in rows] == ["0", "1234"]


@pytest.mark.usefixtures("quick_trials")
def test_results_keep_word_checksum_and_copy_so_that_resume_and_report_find_them(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = ("sim", "--forests", "reference", "--trials", 4, "--jobs", 1, "--out", out)
    succeed(run, *command)
    assert json.loads((out / "campaign.json").read_text())["forests"] == {"file": "reference", "blake2b": CHECKSUM}
    succeed(run, *command, "--resume")
    assert Results.open(out).rebuild().make_forest(3).noise == 2026


@pytest.mark.usefixtures("quick_trials")
def test_sweep_takes_the_word(run: Run, tmp_path: Path) -> None:
    options = ("--trials", 2, "--jobs", 1, "--forests", "reference", "--out", tmp_path / "out")
    succeed(run, "sweep", "escape.turn_angle_deg=10,30", *options)
    assert CHECKSUM in (tmp_path / "out" / "campaign.json").read_text()


@pytest.mark.parametrize("command", ["sim", "sweep"])
def test_help_names_it(run: Run, command: str) -> None:
    assert "FILE|reference" in run(command, "--help")[1]
