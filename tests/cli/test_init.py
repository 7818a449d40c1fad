"""``wayfarer init``: what is written and printed, what is left as it is, and its exit codes."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from wayfarer.cli import init
from wayfarer.commissioning.first_rover import FoundPart, Inventory
from wayfarer.config.rover_file import load_rover
from wayfarer.daemon.socket.paths import AlreadyRunning, daemon_socket, single_daemon

LOOK = init._look
NOTHING = Inventory([("nothing", "/dev/i2c-*: there is no I2C bus")])
BOARD = FoundPart("thunderborg", {"bus": "/dev/i2c-3", "address": 0x15}, "ThunderBorg at 0x15 on /dev/i2c-3")


@pytest.fixture(autouse=True)
def nothing_is_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, own_folders: Path) -> None:
    monkeypatch.setattr(init, "_look", lambda: NOTHING)
    monkeypatch.chdir(tmp_path)


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_file_loads_and_what_was_seen_and_what_comes_next_is_said(run: Run, tmp_path: Path) -> None:
    code, out, err = run("init")
    assert (code, out.splitlines()) == (
        0,
        [
            "nothing /dev/i2c-*: there is no I2C bus",
            "wrote my-rover.toml, from forestrover.toml: fill in what FILL IN marks in it",
        ],
    )
    assert err == "Next: wayfarer check --rover ./my-rover.toml\n"
    assert load_rover("./my-rover.toml").name == "my-rover"
    assert names(tmp_path) == ["my-rover.toml"]


@pytest.mark.parametrize("argument", ["otter", "otter.toml", "./otter.toml", "./otter", "otter/"])
def test_name_and_file_write_the_same(run: Run, tmp_path: Path, argument: str) -> None:
    assert run("init", argument)[0] == 0
    assert names(tmp_path) == ["otter.toml"]
    assert load_rover("./otter.toml").name == "otter"


@pytest.mark.parametrize(
    ("arguments", "motors"),
    [
        ([], "thunderborg"),
        (["minirover"], "thunderborg"),
        (["forestrover"], "thunderborg"),  # what answered is put in, whatever the file begins from
    ],
)
def test_file_begins_from_the_rover_that_is_named_or_the_nearest(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], motors: str
) -> None:
    monkeypatch.setattr(init, "_look", lambda: Inventory(parts={"motors": BOARD}))
    assert run("init", *arguments)[0] == 0
    rover = load_rover(f"./{names(tmp_path)[0]}")
    assert (rover.parts["motors"]["driver"], rover.parts["motors"]["bus"]) == (motors, "/dev/i2c-3")
    like = "forestrover" if "forestrover" in arguments else "minirover"
    assert rover.vehicle == load_rover(like).vehicle


@pytest.mark.parametrize("there", ["file", "dead link"])
def test_no_file_is_overwritten(run: Run, tmp_path: Path, there: str) -> None:
    if there == "file":
        (tmp_path / "mine.toml").write_text("mine", encoding="utf-8")
    else:
        (tmp_path / "mine.toml").symlink_to("nowhere")
    assert "mine.toml exists and is left as it is" in refusal(run, "init", "mine.toml")
    assert names(tmp_path) == ["mine.toml"]


def test_a_file_that_came_meanwhile_is_not_overwritten(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def look() -> Inventory:
        (tmp_path / "my-rover.toml").write_text("mine", encoding="utf-8")
        return NOTHING

    monkeypatch.setattr(init, "_look", look)
    code, _, err = run("init")
    assert (code, "exists and is left as it is" in err) == (2, True)
    assert (tmp_path / "my-rover.toml").read_text(encoding="utf-8") == "mine"
    assert names(tmp_path) == ["my-rover.toml"]


def test_what_cannot_be_a_file_or_a_name_is_said_in_one_line(run: Run, tmp_path: Path) -> None:
    assert "no: no such folder" in refusal(run, "init", "no/rover.toml")
    for nameless in ("", ".", "..", "/", ".toml", "./.toml"):
        assert "the rover has no name" in refusal(run, "init", nameless)
    code, _, err = run("init", "o" * 41)
    assert (code, "key 'name'" in err, err.count("\n")) == (2, True, 1)
    assert names(tmp_path) == []


def test_nothing_is_looked_at_while_a_daemon_runs(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(init, "_look", LOOK)
    with single_daemon(daemon_socket()):
        code, _, err = run("init")
    assert code == AlreadyRunning.exit_code, err
    assert names(tmp_path) == []
