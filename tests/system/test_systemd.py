"""A real systemd runs the service with the simulated rover: one boot, all scenarios (see scenario.py)."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from tests.system import nspawn

Report = dict[str, Any]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of what happened in the one boot."""
    reason = nspawn.why_not(tmp_path_factory.mktemp("trial"))
    if reason is not None:
        pytest.skip(reason)
    folder = nspawn.boot(Path(__file__).with_name("scenario.py"), tmp_path_factory.mktemp("systemd"))
    if not (folder / "driver.txt").is_file():
        console = (folder / "console.txt").read_text(encoding="utf-8").strip()
        pytest.skip(f"no systemd comes up in a container here: {console[-500:]}")
    return folder


@pytest.fixture
def report(results: Path) -> Report:
    """What each step saw; the journal is shown if a test fails."""
    for journal in results.glob("journal.txt"):
        print(journal.read_text(encoding="utf-8")[-6000:])
    found: Report = json.loads((results / "report.json").read_text(encoding="utf-8"))
    return found


def step(report: Report, name: str) -> Report:
    assert name in report, f"the container was ended after {list(report)}"
    found: Report = report[name]
    assert "error" not in found, found["error"]
    return found


def test_unit_is_written_twice_without_harm_and_the_command_that_it_says_makes_the_user(report: Report) -> None:
    seen = step(report, "install")
    assert [seen[name]["code"] for name in ("first", "make_user", "second")] == [0, 0, 0], seen
    assert "(wayfarer)" in seen["user"]["out"]
    assert "(dialout)" in seen["user"]["out"]


def test_systemd_finds_nothing_wrong_with_the_unit(report: Report) -> None:
    verify = step(report, "install")["verify"]
    assert (verify["code"], verify["out"] + verify["err"]) == (0, "")


def test_is_active_only_once_the_daemon_says_so_and_then_disarmed(report: Report) -> None:
    seen = step(report, "start")
    assert seen["states"][-2:] == ["activating", "active"]
    assert seen["state"]["NRestarts"] == "0"
    assert seen["mode"] == "disarmed"


def test_arms_by_command(report: Report) -> None:
    assert step(report, "arm")["mode"] == "armed"


@pytest.mark.parametrize(
    ("name", "result", "restarts"),
    [("kill", "signal", "1"), ("suspend", "watchdog", "2"), ("exception", "exit-code", "1")],
)
def test_daemon_that_is_killed_suspended_or_fails_comes_back_disarmed(
    report: Report, name: str, result: str, restarts: str
) -> None:
    seen = step(report, name)
    assert seen["down"]["Result"] == result
    assert seen["stops_sent"] == 1, "by ExecStopPost=, before the restart"
    assert (seen["up"]["NRestarts"], seen["mode"]) == (restarts, "disarmed")


def test_suspended_daemon_is_noticed_by_the_watchdog(report: Report) -> None:
    assert step(report, "suspend")["took_s"] < 23  # 10 s watchdog, 2 s to abort, 5 s pause, and the start


def test_stop_stops_the_wheels_at_once_and_ends_the_log(report: Report) -> None:
    seen = step(report, "stop")
    assert seen["moved"], "the rover was to be driving"
    (stopped_wall_s,) = [event["t_wall"] for event in seen["events"] if event["name"] == "wheels_stopped"]
    assert stopped_wall_s - seen["asked_wall_s"] < 1
    assert seen["took_s"] < 10, "TimeoutStopSec is 15: nothing was waited out"
    assert seen["stops_sent"] == 1, "by ExecStopPost= once more"
    assert (seen["state"]["ActiveState"], seen["state"]["Result"]) == ("inactive", "success")
    assert seen["last"]["record"] == "outcome"
    assert seen["left_in_run"] == []


def test_run_that_ended_as_it_should_stays_ended(report: Report) -> None:
    seen = step(report, "end")
    assert seen["answer"]["code"] == 0, seen["answer"]
    assert (seen["state"]["ActiveState"], seen["state"]["Result"]) == ("inactive", "success")


def test_starts_where_nothing_can_be_logged_and_drives_only_if_told_to(report: Report) -> None:
    seen = step(report, "read_only")
    assert (seen["started"]["code"], seen["refused"]["code"]) == (0, 1), seen
    assert "the field log cannot be written: Read-only file system" in seen["refused"]["err"]
    assert seen["refused"]["err"].endswith("; without a log: wayfarer arm --without-log\n")
    assert seen["armed"]["code"] == 0, seen["armed"]


def test_killed_daemon_s_own_motors_are_stopped_where_the_rover_file_names_others(report: Report) -> None:
    seen = step(report, "changed_rover_file")
    assert seen["written"]["code"] == 0, seen
    assert seen["stops_sent"] == 1, "ExecStopPost= runs before systemd removes the folder with the record"
    (said,) = seen["said"]
    assert said.startswith("the daemon's /run/wayfarer/motors.json: ")
    assert "; /etc/wayfarer/rover.toml: unknown driver 'no_such_driver'" in said
    assert seen["left_in_run"] == []


@pytest.mark.parametrize("what", ["adapter", "name", "address", "port"])
def test_daemon_is_started_again_until_what_comes_late_is_there(report: Report, what: str) -> None:
    seen = step(report, "late")[what]
    assert int(seen["missed"]["NRestarts"]) >= 1
    assert (seen["up"]["ActiveState"], seen["mode"]) == ("active", "disarmed")


def test_unusable_rover_file_is_not_tried_again(report: Report) -> None:
    seen = step(report, "bad_rover_file")
    assert (seen["ActiveState"], seen["NRestarts"]) == ("failed", "0")


def test_exposure_is_as_low_as_the_notes_say(report: Report, capsys: pytest.CaptureFixture[str]) -> None:
    table = [" ".join(line.split()) for line in step(report, "security")["out"].splitlines()]
    with capsys.disabled():  # docs/how-to/service.md explains each of these
        print("", *[line for line in table if line.startswith(("✗", "→"))], sep="\n")
    exposure = re.search(r"exposure level for wayfarer.service: ([\d.]+)", "\n".join(table))
    assert exposure is not None
    assert float(exposure[1]) <= 2.0
