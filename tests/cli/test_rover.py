"""The commands for a rover: what they ask of the daemon, what they print, and how they refuse."""

from __future__ import annotations

import json
from pathlib import Path
from time import monotonic  # noqa: TID251 - the chips of a real-time check need the loop's own clock
from typing import Any

import pytest

from tests.conftest import Run
from wayfarer import cli
from wayfarer.cli import commissioning, terminal
from wayfarer.cli.status_text import status_text
from wayfarer.commissioning.calibrate import STEPS
from wayfarer.commissioning.checks.deadman import board_settings
from wayfarer.config.calibration_file import (
    FILE_NAME,
    Calibration,
    DeadmanEntry,
    save,
    stamp,
)
from wayfarer.config.rover_file import load_rover
from wayfarer.daemon.driven import motors_lock
from wayfarer.daemon.socket.paths import daemon_socket, single_daemon
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import wall_clock
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chip_wiring import ChipWiring
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

pytestmark = pytest.mark.usefixtures("own_folders")

STATUS: dict[str, Any] = {
    "rover": "minirover", "algorithm": "forest-pledge", "log": "logs/1", "simulated": False, "dry_run": True,
    "mode": "armed", "why_disarmed": None, "being_checked": False, "held": False,
    "conditions": [], "motor_faults": [], "battery_v": 12.04,
    "heading_deg": 359.7, "pitch_deg": 2.0, "roll_deg": -1.0, "goal_heading_deg": 20.0,
    "phase": "stride", "why": "probe.unwound",
    "anomalies": ["immobilised"], "counter_deg": 30.2, "mission_s": 61.0, "travelled_m": 12.34,
}  # fmt: skip


class Daemon:
    """Stands in for the daemon: keeps what it is asked and gives a set answer."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, answer: dict[str, Any] | Exception) -> None:
        self.asked: list[dict[str, object]] = []
        self.answer = answer
        monkeypatch.setattr("wayfarer.daemon.socket.client.ask", self.ask)

    def ask(self, request: dict[str, object], timeout_s: float) -> dict[str, Any]:
        self.asked.append(request)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


# -- to a running rover ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "asked"),
    [
        (["arm"], {"do": "arm"}),
        (["arm", "360"], {"do": "arm", "heading_deg": 0.0, "north": "magnetic"}),
        (["goal", "20.5", "--north", "true"], {"do": "goal", "heading_deg": 20.5, "north": "true"}),
        (["goal", "-20"], {"do": "goal", "heading_deg": 340.0, "north": "magnetic"}),
        (["goal", "-0.5", "--north", "true"], {"do": "goal", "heading_deg": 359.5, "north": "true"}),
        (["goal", "-1e-20"], {"do": "goal", "heading_deg": 0.0, "north": "magnetic"}),
        (["arm", "-20"], {"do": "arm", "heading_deg": 340.0, "north": "magnetic"}),
        (["mark", "hit log"], {"do": "mark", "text": "hit log"}),
        (["mark", "hit", "log"], {"do": "mark", "text": "hit log"}),
        (["mark", "slope", "of", "-20"], {"do": "mark", "text": "slope of -20"}),
        (["hold"], {"do": "hold"}),
        (["resume"], {"do": "resume"}),
        (["disarm"], {"do": "disarm"}),
        (["stop"], {"do": "stop"}),
    ],
)
def test_verb_is_asked_of_the_daemon(
    monkeypatch: pytest.MonkeyPatch, arguments: list[str], asked: dict[str, object]
) -> None:
    answer = {"warnings": [], "start_delay_s": 10.0, "goal_heading_deg": 20.0, "log": "logs/1", "held": True}
    daemon = Daemon(monkeypatch, answer)
    assert cli.run(arguments) == 0
    assert daemon.asked == [asked]


def test_arming_tells_of_warnings_and_of_the_time_to_step_away(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    Daemon(monkeypatch, {"warnings": ["clock: it is 1970"], "start_delay_s": 10.0})
    code, out, _ = run("arm")
    assert (code, out) == (0, "warning: clock: it is 1970\narming: the wheels can turn after 10 s\n")


@pytest.mark.parametrize("verb", ["stop", "arm", "status"])
def test_what_a_terminal_obeys_is_written_out(monkeypatch: pytest.MonkeyPatch, run: Run, verb: str) -> None:
    """A false daemon, or a folder's name, could otherwise write whatever it likes onto the screen."""
    hostile = "logs/\x1b[2J\x9b1m\rstopped"
    status = {"rover": hostile, "mode": hostile, "being_checked": False, "held": False}
    status |= {"conditions": [hostile], "motor_faults": [hostile]}
    Daemon(monkeypatch, {"warnings": [hostile], "start_delay_s": 10.0, "log": hostile, **status})
    code, out, err = run(verb)
    assert code == 0
    assert "\\x1b[2J" in out
    assert all(each.isprintable() for each in (out + err).splitlines())


def test_refusal_is_one_line_and_exit_code_1(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    Daemon(monkeypatch, RequestRefused("not armed: battery: 9.1 V"))
    code, _, err = run("arm")
    assert (code, err) == (1, "wayfarer: not armed: battery: 9.1 V\n")


@pytest.mark.parametrize("arguments", [["status"], ["arm"], ["goal", "20"], ["stop"]])
@pytest.mark.parametrize("answer", [{}, {"warnings": 3, "goal_heading_deg": None, "rover": None}])
def test_answer_of_a_daemon_of_another_version_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], arguments: list[str], answer: dict[str, Any]
) -> None:
    Daemon(monkeypatch, answer)
    assert cli.run(arguments) == 1
    said = capsys.readouterr().err
    assert said.startswith("wayfarer: the command was carried out, but the daemon's answer is not as expected")
    assert said.count("\n") == 1


@pytest.mark.parametrize("verb", ["status", "arm", "disarm", "hold", "resume", "stop"])
def test_without_a_daemon_each_verb_says_how_to_start_one(verb: str, run: Run) -> None:
    code, _, err = run(verb)
    assert code == 1
    assert "wayfarer run" in err


@pytest.mark.parametrize("arguments", [["arm", "361"], ["arm", "-361"], ["goal", "nan"], ["goal"], ["goal", "-x"],
                                       ["arm", "20", "--north", "left"], ["goal", "20", "--nort", "true"], ["mark"],
                                       ["hold", "-2"]])  # fmt: skip
def test_heading_that_cannot_be_is_refused_before_anything_is_asked(
    monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    monkeypatch.setattr("socket.socket.connect", lambda *_: pytest.fail("nothing may be sent"))
    assert cli.run(arguments) == 2


def test_status_says_the_most_important_first() -> None:
    assert status_text(STATUS).splitlines() == [
        "minirover armed (dry run)",
        "health    No faults",
        "doing     Driving straight ahead (forest-pledge), counter 30, stalled",
        "heading   0, goal 20, pitch +2, roll -1",
        "mission   61 s, 12.3 m commanded",
        "battery   12.0 V",
        "log       logs/1",
    ]


@pytest.mark.parametrize("rover", ["sim", "minirover", "forestrover", "x" * 40])
def test_name_of_the_rover_and_its_mode_are_two_words(rover: str) -> None:
    assert status_text({**STATUS, "rover": rover}).splitlines()[0].split() == [rover, "armed", "(dry", "run)"]
    by_hand = {"rover": rover, "mode": "manual", "driver": "page"}
    assert "sim being checked" in " ".join(status_text({**STATUS, "rover": "sim", "being_checked": True}).split())
    assert "driven by hand, by page" in status_text({**STATUS, **by_hand}).splitlines()[0]


@pytest.mark.parametrize(("deadman_s", "told"), [(None, True), (0.3, False)])
def test_status_says_plainly_if_nothing_stops_the_wheels(deadman_s: float | None, told: bool) -> None:
    said = "nothing stops these wheels if the computer fails"
    assert (said in status_text({**STATUS, "board_deadman_s": deadman_s})) is told


def test_status_of_a_disarmed_rover_says_why() -> None:
    disarmed = {"mode": "disarmed", "why_disarmed": "fault: compass_lost", "conditions": ["compass_lost"]}
    lines = status_text({**STATUS, **disarmed, "motor_faults": ["motor A: drive fault"]}).splitlines()
    assert lines[0] == "minirover disarmed: fault: the compass has been silent for seconds (dry run)"
    assert lines[1] == "health    the compass has been silent for seconds, motor A: drive fault"
    assert not any(line.startswith("doing") for line in lines)


def test_status_tells_of_the_mission_before_until_the_rover_is_armed() -> None:
    last_mission = {"run": "00016-x", "text": "The last mission (run 00016-x) is over"}
    status = {**STATUS, "mode": "disarmed", "why_disarmed": "not armed since the start", "last_mission": last_mission}
    before = {key: value for key, value in status.items() if key != "mission_s"}
    told = "before    The last mission (run 00016-x) is over"
    assert told in status_text(before).splitlines()
    assert "The last mission" not in status_text({**before, "mode": "armed", "why_disarmed": None})
    assert "The last mission" not in status_text({**before, "mission_s": 3.0, "travelled_m": 1.0}), "it is another one"


def test_status_of_a_limited_rover_says_since_when_what_it_does_and_until_when() -> None:
    said = {"does": "drives 3 m", "ends_when": "it sees again"}
    limited = {"conditions": ["motion_unknown"], "cause_for_s": 75.0, **said}
    lines = status_text({**STATUS, **limited}).splitlines()
    assert lines[1:4] == [
        "health    the motion sensor's picture is too poor (for 0:01:15)",
        "so it     drives 3 m",
        "until     it sees again",
    ]


def test_status_tells_of_records_that_the_log_has_lost() -> None:
    assert status_text({**STATUS, "log_dropped": 3}).splitlines()[-1].endswith(", 3 records lost")
    trouble = {"log_trouble": f"{STATUS['log']}: no room", "storage_warnings": ["it is worn"], "runs_deleted": 1}
    log, card = status_text({**STATUS, **trouble}).splitlines()[-2:]
    assert (log.split(", ")[-1], card.split()) == ("1 old run deleted", ["card", "no", "room;", "it", "is", "worn"])


# -- run ---------------------------------------------------------------------------------------------------------


def test_run_without_a_rover_names_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, run: Run) -> None:
    monkeypatch.setattr("wayfarer.cli.rover.ROVER_FILE", tmp_path / "none.toml")
    code, _, err = run("run")
    assert code == 2
    assert "wayfarer run --sim" in err


def test_run_without_a_part_names_it_before_any_port(tmp_path: Path, run: Run) -> None:
    shipped = (Path(cli.__file__).parents[1] / "rovers/minirover.toml").read_text(encoding="utf-8")
    before, _, after = shipped.partition("[parts.compass]")
    path = tmp_path / "rover.toml"
    path.write_text(before + "[parts.motion]" + after.partition("[parts.motion]")[2], encoding="utf-8")
    code, _, err = run("run", "--rover", path, "--log-dir", tmp_path / "logs")
    assert code == 2
    assert err.startswith(f"wayfarer: {path}: key 'parts.compass' is missing: rover 'minirover' has no [parts.compass]")


@pytest.mark.parametrize("command", ["run", "check"])
@pytest.mark.parametrize(
    ("buses", "said"),
    [
        ("linuxx", "unknown buses 'linuxx': did you mean linux?"),
        ("no_such:Buses", "buses 'no_such:Buses': cannot import no_such (No module named 'no_such'); is it installed?"),
        ("os:getcwd", "buses 'os:getcwd': os:getcwd does not give a wayfarer.drivers.buses.Buses"),
        ("os:sep", "buses 'os:sep': os:sep gives no buses: TypeError: 'str' object is not callable"),
        ("sys:exit", "buses 'sys:exit': sys:exit gives no buses: SystemExit"),
    ],
)
def test_buses_that_cannot_be_are_told_by_file_and_key(
    tmp_path: Path, run: Run, command: str, buses: str, said: str
) -> None:
    path = tmp_path / "rover.toml"
    shipped = (Path(cli.__file__).parents[1] / "rovers/minirover.toml").read_text(encoding="utf-8")
    path.write_text(f'buses = "{buses}"\n{shipped}', encoding="utf-8")
    code, _, err = run(command, "--rover", path, "--log-dir", tmp_path)
    assert (code, err) == (2, f"wayfarer: {path}: key 'buses': {said}\n")


@pytest.mark.parametrize("command", [["run", "--sim"], ["check", "--rover", "forestrover"]])
def test_running_daemon_is_left_alone_with_the_exit_code_for_later(run: Run, command: list[str]) -> None:
    with single_daemon(daemon_socket()):
        code, _, err = run(*command)
    assert code == 75
    assert "is running already" in err


# -- check -------------------------------------------------------------------------------------------------------


def buses() -> FakeBuses:
    """Forestrover's chips, in a clearing."""
    chips = FakeBuses()
    config = load_rover("forestrover")
    world = World(CLEARING, config.vehicle, Physics(), RandomStreams(0), starts_s=monotonic())
    wiring = ChipWiring(world, RandomStreams(0), monotonic, chips)
    for part, table in config.parts.items():
        wiring.attach(part, table)
    return chips


@pytest.fixture
def rover_file(tmp_path: Path) -> Path:
    shipped = (Path(cli.__file__).parents[1] / "rovers/forestrover.toml").read_text(encoding="utf-8")
    path = tmp_path / "rover.toml"
    path.write_text('buses = "tests.cli.test_rover:buses"\n' + shipped, encoding="utf-8")
    return path


def test_check_of_a_sound_rover_passes_and_turns_no_wheel_without_a_person(
    own_folders: Path, rover_file: Path, tmp_path: Path, run: Run
) -> None:
    settings = board_settings(load_rover(str(rover_file)))
    seen = DeadmanEntry(**stamp("Sabertooth", wall_clock(0.0)), settings=settings)
    save(own_folders / "state" / FILE_NAME, Calibration(deadman=seen))
    code, out, _ = run("check", "--json", "--rover", rover_file, "--log-dir", tmp_path)
    assert code == 0
    told = json.loads(out)
    verdicts = {finding["name"]: finding["verdict"] for finding in told["findings"]}
    assert told["passed"]
    assert (verdicts["compass"], verdicts["motion"], verdicts["motor board"]) == ("ok", "ok", "ok")
    assert (verdicts["deadman trips"], verdicts["left wheels"]) == ("skipped", "skipped")


def test_check_for_people_gives_cause_and_remedy(rover_file: Path, run: Run) -> None:
    rover_file.write_text(rover_file.read_text(encoding="utf-8").replace("address = 0x60", "address = 0x61"))
    code, out, _ = run("check", "--rover", rover_file, "--log-dir", rover_file.parent)
    assert code == 1
    lines = out.splitlines()
    at = next(number for number, line in enumerate(lines) if line.startswith("fail    compass:"))
    assert "0x61" in lines[at]
    assert "; likely " in lines[at]
    assert lines[at + 1].startswith("          do: ")


@pytest.mark.parametrize("command", [["check"], ["calibrate", "motors"]])
def test_motors_of_a_daemon_on_another_socket_are_left_alone(
    rover_file: Path, monkeypatch: pytest.MonkeyPatch, run: Run, command: list[str]
) -> None:
    monkeypatch.setattr(terminal, "is_interactive", lambda: True)
    monkeypatch.setattr("wayfarer.daemon.driven.motors_device", lambda config: "/dev/ptmx")
    with motors_lock("/dev/ptmx"):
        code, _, err = run(*command, "--rover", rover_file)
    assert code == 75
    assert "drives these motors (/dev/ptmx)" in err


def test_check_uses_the_calibration_and_calibrate_begins_without_it(
    own_folders: Path, rover_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = Calibration(deadman=DeadmanEntry(**stamp("Sabertooth", 1.0), settings={}))
    save(own_folders / "state" / FILE_NAME, stored)
    used: list[Calibration] = []

    def connect(config: Any, where: str, calibration: Calibration, **_: object) -> Any:
        used.append(calibration)
        raise BadInput("that is enough")

    monkeypatch.setattr(terminal, "is_interactive", lambda: True)
    monkeypatch.setattr("wayfarer.config.factory.connect", connect)
    for command in (["check"], ["calibrate", "motors"]):
        assert cli.run([*command, "--rover", str(rover_file)]) == 2
    assert used == [stored, Calibration()]


def test_every_step_of_calibrating_can_be_named() -> None:
    assert tuple(step.value for step in commissioning.CalibrationStep) == STEPS


def test_calibrating_wants_a_person(rover_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terminal, "is_interactive", lambda: False)
    assert cli.run(["calibrate", "--rover", str(rover_file)]) == 2


def test_status_shows_where_the_run_can_be_watched() -> None:
    addresses = {"live_page": "http://127.0.0.1:8088/?token=s3cret", "mavlink": "udpout:192.168.1.5:14550"}
    assert status_text({**STATUS, **addresses}).splitlines()[-2:] == [
        "live page http://127.0.0.1:8088/?token=s3cret",
        "MAVLink   udpout:192.168.1.5:14550",
    ]
