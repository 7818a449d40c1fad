"""What ``wayfarer sim`` does with its options: rovers that it refuses before the first trial, and where logs go."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Run, refusal
from wayfarer import cli
from wayfarer.fieldlog.reader import find_header

BODY = """
name = "test"
[vehicle]
length_m = 0.4
width_m = 0.4
track_m = 0.5
max_speed_m_s = 1.0
"""
COMPASS = '[parts.compass]\ndriver = "cmps14"\n'
THUNDERBORG = '[parts.motors]\ndriver = "thunderborg"\n'
CHIPLESS = '[parts.compass]\ndriver = "tests.fake_plugins:Chipless"\n'
UNBUILDABLE = {
    "no motors": (COMPASS, "rover 'test' has no [parts.motors]"),
    "no compass": (THUNDERBORG, "rover 'test' has no [parts.compass]"),
    "no parts": ("", "rover 'test' has no [parts.compass]"),
    "no such chip": (THUNDERBORG + CHIPLESS, "no simulated chip for"),
    "two chips at one address": (COMPASS + THUNDERBORG + "address = 0x60\n", "parts.compass has this address"),
}


COMMANDS = {
    "all": ["sim", "--jobs", "1", "--out", "out", "--rover"],
    "alone": ["sim", "--trial", "0", "--log-dir", "log", "--rover"],
    "daemon": ["run", "--sim", "--rover"],
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
@pytest.mark.parametrize(("parts", "says"), UNBUILDABLE.values(), ids=UNBUILDABLE)
def test_rover_that_cannot_be_built_is_one_line_before_anything_starts(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parts: str, says: str, command: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("wayfarer.experiments.trial.run_trial", lambda *_: pytest.fail("a trial was run"))
    Path("rover.toml").write_text(BODY + parts, encoding="utf-8")
    err = refusal(run, *command, "./rover.toml", "--depth", "bus")
    assert err.startswith("wayfarer: ./rover.toml: key 'parts.")
    assert says in err
    assert [path.name for path in tmp_path.iterdir()] == ["rover.toml"]


def test_rover_without_parts_can_be_simulated_at_device_depth(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "rover.toml").write_text(BODY, encoding="utf-8")
    options = ["--trial", "0", "--budget-m", "1", "--rover", str(tmp_path / "rover.toml")]
    assert cli.run(["sim", *options]) == 0
    assert "entrapped" in capsys.readouterr().out


@pytest.mark.process
def test_campaign_with_a_log_gives_each_trial_its_own(tmp_path: Path) -> None:
    options = ["--trials", "2", "--algorithm", "pledge,levy-walk", "--budget-m", "5", "--jobs", "2"]
    assert cli.run(["sim", *options, "--log-dir", str(tmp_path / "logs")]) == 0
    runs = sorted((tmp_path / "logs").iterdir())
    assert [run.name for run in runs] == ["levy-walk-00000", "levy-walk-00001", "pledge-00000", "pledge-00001"]
    for run in runs:
        header = find_header(run)
        assert header is not None
        assert run.name == f"{header.algorithm}-{header.trial:05d}"


def test_campaign_refuses_a_folder_that_has_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "forest-pledge-00000").mkdir()
    assert cli.run(["sim", "--trials", "1", "--log-dir", str(tmp_path)]) == 2
    assert "the log needs a new or empty folder" in capsys.readouterr().err
