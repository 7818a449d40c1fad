"""``wayfarer init``: what is written and printed, what is left where it ends early, and its exit codes."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from wayfarer.cli import init
from wayfarer.commissioning.init import Inventory, Sighting, Verdict
from wayfarer.config.rover_file import load_rover, parse_rover
from wayfarer.daemon.socket.paths import AlreadyRunning, daemon_socket, single_daemon

LOOK = init._look
NOTHING = Inventory([Sighting(Verdict.NOTHING, "/dev/i2c-*: there is no I2C bus")])


@pytest.fixture(autouse=True)
def nothing_is_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, own_folders: Path) -> None:
    monkeypatch.setattr(init, "_look", lambda: NOTHING)
    monkeypatch.chdir(tmp_path)


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def type_in(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(text))


def test_yes_writes_a_file_that_loads_and_says_what_comes_next(run: Run, tmp_path: Path) -> None:
    code, out, err = run("init", "--yes")
    assert (code, out) == (0, "wrote rover.toml\n")
    assert "nothing /dev/i2c-*: there is no I2C bus\nNothing was found that a rover can be made of.\n" in err
    assert err.endswith("Next: wayfarer check --rover ./rover.toml\n")
    assert load_rover("./rover.toml").name == "my-rover"
    assert names(tmp_path) == ["rover.toml"]


def test_dry_run_prints_the_file_alone_and_writes_nothing(run: Run, tmp_path: Path) -> None:
    (tmp_path / "rover.toml").write_text("mine", encoding="utf-8")
    code, out, _ = run("init", "--yes", "--dry-run")
    assert code == 0
    assert parse_rover("rover.toml", out).name == "my-rover"
    assert (tmp_path / "rover.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("there", ["file", "dead link"])
def test_no_file_is_overwritten(run: Run, tmp_path: Path, there: str) -> None:
    if there == "file":
        (tmp_path / "mine.toml").write_text("mine", encoding="utf-8")
    else:
        (tmp_path / "mine.toml").symlink_to("nowhere")
    assert "mine.toml exists and is left as it is" in refusal(run, "init", "--yes", "mine.toml")
    assert names(tmp_path) == ["mine.toml"]


def test_a_file_that_came_meanwhile_is_not_overwritten(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def look() -> Inventory:
        (tmp_path / "rover.toml").write_text("mine", encoding="utf-8")
        return NOTHING

    monkeypatch.setattr(init, "_look", look)
    code, _, err = run("init", "--yes")
    assert (code, "exists and is left as it is" in err) == (2, True)
    assert (tmp_path / "rover.toml").read_text(encoding="utf-8") == "mine"
    assert names(tmp_path) == ["rover.toml"]


def test_answers_are_not_asked_and_a_wrong_one_is_named_with_its_line(run: Run, tmp_path: Path) -> None:
    answers = tmp_path / "answers.toml"
    answers.write_text('name = "otter"\n[vehicle]\nwidth_m = 0.5\n', encoding="utf-8")
    assert run("init", "--yes", "--answers", answers)[0] == 0
    rover = load_rover("./rover.toml")
    assert (rover.name, rover.vehicle.width_m, rover.vehicle.track_m) == ("otter", 0.5, 0.62)
    answers.write_text("[vehicle]\nwidth_m = -1\n", encoding="utf-8")
    code, _, err = run("init", "--yes", "--answers", "answers.toml", "other.toml")
    assert (code, err.splitlines()[-1]) == (
        2,
        "wayfarer: answers.toml: key 'vehicle.width_m' = -1: input should be greater than 0;"
        " allowed is above 0 to 1000 (line 2)",
    )
    answers.write_text("[parts.motors]\nport = 1979-05-27\n", encoding="utf-8")  # a date, which was meant as a text
    assert run("init", "--yes", "--answers", answers, "dated.toml")[0] == 0
    assert load_rover("./dated.toml").parts["motors"]["port"] == "1979-05-27"
    answers.write_text("[vehicle\n", encoding="utf-8")
    assert "answers.toml: not valid TOML" in refusal(run, "init", "--yes", "--answers", "answers.toml", "other.toml")


def test_a_person_is_asked_and_may_say_no(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    type_in(monkeypatch, "no\nfalse\nNo\n")
    code, _, err = run("init")
    assert code == 1
    assert "'false' is neither yes nor no\n" in err
    assert err.endswith("nothing was written\n")
    assert "Look now? (yes, no)" in err
    assert "Write a file with the defaults of ForestRover? (yes, no)" in err
    assert names(tmp_path) == []


@pytest.mark.parametrize("typed", ["", "yes\nyes\nsabertooth\n"])
def test_end_of_the_input_is_bad_input_and_leaves_nothing(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: str
) -> None:
    type_in(monkeypatch, typed)
    code, _, err = run("init")
    assert code == 2
    assert err.endswith("no answer: the input has ended; nothing was written (--yes takes every default)\n")
    assert names(tmp_path) == []


def test_a_folder_that_is_not_there_is_said_first(run: Run) -> None:
    assert "no: no such folder" in refusal(run, "init", "no/rover.toml", "--yes")


def test_nothing_is_looked_at_while_a_daemon_runs(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(init, "_look", LOOK)
    with single_daemon(daemon_socket()):
        code, _, err = run("init", "--yes")
    assert code == AlreadyRunning.exit_code, err
    assert names(tmp_path) == []
