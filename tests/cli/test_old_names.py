"""Options by the names that they had before: accepted where the command has the new one, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from tests.system.hil_setup import CHECKOUT

FIELD_LOGS = str(CHECKOUT / "field_logs")
OLD_AND_NEW = {
    "logs list --logs": "logs list --log-dir",
    "replay 1 --logs": "replay 1 --log-dir",
}


@pytest.mark.parametrize(("old", "new"), OLD_AND_NEW.items(), ids=OLD_AND_NEW)
def test_old_name_does_what_the_new_one_does(run: Run, old: str, new: str) -> None:
    done = run(*new.split(), FIELD_LOGS)
    assert done[0] == 0
    assert run(*old.split(), FIELD_LOGS) == done
    *command, option = old.split()
    assert run(*command, f"{option}={FIELD_LOGS}") == done


@pytest.mark.usefixtures("own_folders")
@pytest.mark.parametrize("command", ["run --sim", "check", "calibrate", "replay"])
def test_config_is_the_rover(run: Run, command: str) -> None:
    if command != "calibrate":  # which asks for a terminal first
        assert "unknown rover 'nowhere'" in refusal(run, *command.split(), "--config", "nowhere")
    assert "'--rover' requires an argument" in refusal(run, *command.split(), "--config")


@pytest.mark.usefixtures("own_folders")
def test_unit_of_an_older_version_still_stops_its_motors(run: Run, tmp_path: Path) -> None:
    missing = tmp_path / "rover.toml"
    assert f"{missing}: cannot be read" in refusal(run, "stop-motors", "--config", missing)


def test_scenario_and_log_of_a_trial_are_its_site_and_its_log_dir(run: Run, tmp_path: Path) -> None:
    trial = ("sim", "--rover", "minirover", "--trial", "0", "--budget-m", "1")
    new = run(*trial, "--site", "extended-maze", "--log-dir", tmp_path / "new")
    old = run(*trial, "--scenario", "extended-maze", "--log", tmp_path / "old")
    assert (old[0], old[1]) == (0, new[1])
    assert (tmp_path / "old" / "run.jsonl").exists()


@pytest.mark.parametrize("command", ["demo --config sim", "run --scenario x", "status --logs x"])
def test_a_command_without_the_new_name_has_no_old_one(run: Run, command: str) -> None:
    assert f"No such option: {command.split()[1]}" in refusal(run, *command.split())
