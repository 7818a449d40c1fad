"""Stopping without the daemon: what a daemon recorded, a daemon that is still there, and the command."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest

from tests.daemon.left_turning import BUSES, SABERTOOTH, STILL, THUNDERBORG, bench, stop
from tests.daemon.socket.fake_daemon import FakeDaemon, serve
from wayfarer import cli
from wayfarer.daemon.driven import DrivenBoard, motors_lock, write_record
from wayfarer.daemon.socket.client import NoDaemon
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.daemon.stop_motors import stop_motors
from wayfarer.errors import BadInput, WayfarerError

NOBODY = 65534

pytestmark = pytest.mark.usefixtures("left_turning")


# -- what a daemon recorded ------------------------------------------------------------------------------------------


@pytest.fixture
def record(path: Path) -> Path:
    """What a daemon that drives the ThunderBorg left beside its socket."""
    write_record(path, DrivenBoard({"driver": "thunderborg"}, "tests.daemon.left_turning:buses"))
    return path.with_name("motors.json")


def test_board_that_is_driven_is_stopped_and_so_is_another_one_that_the_file_names_now(
    rover_file: Path, record: Path
) -> None:
    said = stop(rover_file, BUSES + SABERTOOTH)
    assert (bench.by_i2c.commanded, bench.by_serial.commanded) == (STILL, STILL)
    driven, named = said.split("; ")
    assert driven == f"the daemon's {record}: ThunderBorg at 0x15 on /dev/i2c-1 says that the wheels are stopped"
    assert named == f"{rover_file}: stop was sent to Sabertooth 128 on /dev/serial0, which cannot confirm it"


def test_same_board_from_both_is_stopped_once(rover_file: Path, record: Path) -> None:
    said = stop(rover_file, BUSES + THUNDERBORG)
    assert said == (
        f"the daemon's {record} and {rover_file}: ThunderBorg at 0x15 on /dev/i2c-1 says that the wheels are stopped"
    )


@pytest.mark.parametrize(
    "text", [None, "a = = 3", "[parts.motors]\ndriver = 'no_such'\n", SABERTOOTH + "timeout_s = 30\n"]
)
def test_rover_file_that_cannot_be_used_is_told_and_the_driven_board_is_stopped(
    rover_file: Path, record: Path, text: str | None
) -> None:
    said = stop_motors(str(rover_file)) if text is None else stop(rover_file, BUSES + text)
    assert bench.by_i2c.commanded == STILL
    assert said.startswith(f"the daemon's {record}: ThunderBorg at 0x15 on /dev/i2c-1 says")
    assert f"; {rover_file}: " in said


@pytest.mark.parametrize(
    ("table", "silent"),
    [(BUSES + THUNDERBORG + "address = 0x17\n", "rover.toml"), (BUSES + SABERTOOTH, "motors.json")],
    ids=["of the file", "of the daemon"],
)
def test_board_that_does_not_answer_is_told_beside_the_one_that_was_stopped(
    rover_file: Path, record: Path, path: Path, table: str, silent: str
) -> None:
    if silent == "motors.json":
        elsewhere = DrivenBoard({"driver": "thunderborg", "address": 0x18}, "tests.daemon.left_turning:buses")
        write_record(path, elsewhere)
    with pytest.raises(WayfarerError) as caught:
        stop(rover_file, table)
    assert caught.value.exit_code == 1
    (failed,) = (each for each in str(caught.value).split("; ") if "no stop was acknowledged" in each)
    assert silent in failed
    assert (bench.by_serial if silent == "motors.json" else bench.by_i2c).commanded == STILL


def test_recorded_driver_that_is_gone_is_no_success(rover_file: Path, path: Path) -> None:
    write_record(path, DrivenBoard({"driver": "no.such:Driver"}, "linux"))
    with pytest.raises(
        WayfarerError, match=r"motors\.json: driver 'no\.such:Driver': cannot import.*are stopped"
    ) as caught:
        stop(rover_file, BUSES + THUNDERBORG)
    assert caught.value.exit_code == 1
    assert bench.by_i2c.commanded == STILL


# -- a daemon that is still there ----------------------------------------------------------------------------------


def ask_that(monkeypatch: pytest.MonkeyPatch, path: Path, answers: Callable[[], object]) -> list[object]:
    """Have somebody answer at the socket; return what it is asked."""
    asked: list[object] = []

    def ask(request: object, place: Path, timeout_s: float) -> object:
        assert place == path
        assert timeout_s <= 1.0
        asked.append(request)
        return answers()

    path.touch()
    monkeypatch.setattr("wayfarer.daemon.socket.client.ask", ask)
    return asked


def drive_on() -> object:
    """What a daemon that ends still had on its way."""
    assert bench.by_i2c.commanded == STILL, "the wheels are stopped before anybody is asked anything"
    chip = bench.buses.i2c("/dev/i2c-1").chip_at(0x15)
    chip.write(bytes((8, 242)))
    return {}


def test_daemon_is_asked_to_stop_and_what_it_still_sent_is_taken_back(
    rover_file: Path, monkeypatch: pytest.MonkeyPatch, path: Path
) -> None:
    asked = ask_that(monkeypatch, path, drive_on)
    assert "says that the wheels are stopped" in stop(rover_file, BUSES + THUNDERBORG)
    assert asked == [{"do": "stop"}]
    assert bench.by_i2c.commanded == STILL


@pytest.mark.parametrize("text", ["a = = 3", "[parts.motors]\ndriver = 'no_such'\n"])
def test_daemon_is_asked_to_stop_though_neither_record_nor_rover_file_can_be_used(
    rover_file: Path, path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """It began with a file that was whole then."""
    rover_file.write_text(text, encoding="utf-8")
    asked = ask_that(monkeypatch, path, dict)
    with pytest.raises(BadInput) as refused:
        stop_motors(str(rover_file))
    assert str(refused.value).endswith(f"; the daemon at {path} says that it stops")
    assert len(asked) == 1


@pytest.mark.parametrize("error", [RequestRefused("no"), WayfarerError("did not answer within 1 s")])
def test_daemon_that_does_not_agree_is_no_assurance(
    rover_file: Path, monkeypatch: pytest.MonkeyPatch, path: Path, error: Exception
) -> None:
    def answers() -> None:
        drive_on()
        raise error

    ask_that(monkeypatch, path, answers)
    with pytest.raises(WayfarerError, match=r"stop was sent, but .*control\.sock still commands these wheels: end it"):
        stop(rover_file, BUSES + THUNDERBORG)
    assert bench.by_i2c.commanded == STILL


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A serial port, with the Sabertooth at it."""
    ends = os.openpty()
    name = os.ttyname(ends[1])
    chip = bench.buses.serial("/dev/serial0").chip
    assert chip is not None
    bench.buses.serial(name).attach(chip)
    monkeypatch.setattr("wayfarer.daemon.stop_motors.make_buses", lambda _: bench.buses)
    yield name
    for end in ends:
        os.close(end)


@pytest.mark.parametrize("another_agrees", [False, True])
def test_daemon_of_another_user_is_found_by_its_lock(
    rover_file: Path, path: Path, port: str, monkeypatch: pytest.MonkeyPatch, another_agrees: bool
) -> None:
    """Also if this user's own daemon, perhaps of a simulated rover, says that it stops."""
    if another_agrees:
        ask_that(monkeypatch, path, dict)
        monkeypatch.setattr("wayfarer.daemon.stop_motors.ENDS_S", 0.2)
    table = SABERTOOTH + f'port = "{port}"\n'
    who = rf"another wayfarer \(process {os.getpid()}\)"
    with motors_lock(port), pytest.raises(WayfarerError, match=f"stop was sent, but {who} still commands these wheels"):
        stop(rover_file, table)
    assert bench.by_serial.commanded == STILL
    assert "stop was sent to" in stop(rover_file, table)


def test_daemon_that_agrees_has_time_to_end(
    rover_file: Path, path: Path, port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    lock = motors_lock(port)
    lock.__enter__()
    ends = threading.Timer(0.3, lock.__exit__, (None, None, None))

    def agrees() -> object:
        ends.start()
        return {}

    ask_that(monkeypatch, path, agrees)
    assert "stop was sent to" in stop(rover_file, SABERTOOTH + f'port = "{port}"\n')
    ends.join()


@pytest.mark.parametrize("left_behind", [False, True])
def test_without_a_daemon_nothing_is_waited_for(
    rover_file: Path, monkeypatch: pytest.MonkeyPatch, path: Path, left_behind: bool
) -> None:
    def nobody() -> None:
        raise NoDaemon("nobody listens")

    if left_behind:
        ask_that(monkeypatch, path, nobody)
    monkeypatch.setattr("asyncio.sleep", lambda _: pytest.fail("it waits"))
    assert "are stopped" in stop(rover_file, BUSES + THUNDERBORG)


def test_real_path_is_told_to_stop(rover_file: Path, path: Path) -> None:
    told: list[tuple[object, ...]] = []
    ready, over = threading.Event(), threading.Event()

    async def listen() -> None:
        daemon = FakeDaemon()
        async with serve(daemon, path):
            ready.set()
            await asyncio.to_thread(over.wait)
        told.extend(daemon.told)

    thread = threading.Thread(target=lambda: asyncio.run(listen()))
    thread.start()
    assert ready.wait(5.0)
    try:
        assert "are stopped" in stop(rover_file, BUSES + THUNDERBORG)
    finally:
        over.set()
        thread.join()
    assert told == [("stop",)]


# -- the command -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "code", "out", "err"),
    [
        (THUNDERBORG, 0, "says that the wheels are stopped\n", ""),
        (THUNDERBORG + "address = 0x17\n", 1, "", "power off\n"),
        ("", 2, "", "no stop is certain: switch the motors' power off\n"),
    ],
    ids=["stopped", "silent board", "no motors"],
)
def test_command_says_in_one_line_and_by_its_exit_code_whether_the_wheels_stand_still(
    capsys: pytest.CaptureFixture[str], rover_file: Path, table: str, code: int, out: str, err: str
) -> None:
    rover_file.write_text(BUSES + table, encoding="utf-8")
    assert cli.run(["stop-motors", "--rover", str(rover_file)]) == code
    captured = capsys.readouterr()
    for said, expected in ((captured.out, out), (captured.err, err)):
        assert said.endswith(expected)
        assert said.count("\n") == (1 if expected else 0)


def test_command_without_any_rover_file_says_what_to_name(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("wayfarer.cli.rover.ROVER_FILE", tmp_path / "none.toml")
    assert cli.run(["stop-motors"]) == 2
    assert "name one with --rover" in capsys.readouterr().err


def test_file_of_the_system_is_stopped_without_being_named(monkeypatch: pytest.MonkeyPatch, rover_file: Path) -> None:
    rover_file.write_text(BUSES + SABERTOOTH, encoding="utf-8")
    monkeypatch.setattr("wayfarer.cli.rover.ROVER_FILE", rover_file)
    assert cli.run(["stop-motors"]) == 0
    assert bench.by_serial.commanded == STILL


# -- code that a file names ------------------------------------------------------------------------------------------


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The buses of what root stops, in order; nothing is imported."""
    names: list[str] = []

    async def stopped(driven: DrivenBoard) -> str:
        names.append(driven.buses)
        return "stopped"

    monkeypatch.setattr("wayfarer.daemon.stop_motors._stop", stopped)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    return names


def owned(monkeypatch: pytest.MonkeyPatch, theirs: Path, uid: int) -> None:
    """Let a file belong to a user."""
    inode, fstat = theirs.stat().st_ino, os.fstat

    def about(number: int) -> os.stat_result:
        there = fstat(number)
        return os.stat_result((*there[:4], uid if there.st_ino == inode else 0, *there[5:]))

    monkeypatch.setattr(os, "fstat", about)


CODE = ('buses = "os:abort"\n' + THUNDERBORG, '[parts.motors]\ndriver = "os:abort"\n')


@pytest.mark.parametrize("named", CODE)
@pytest.mark.parametrize(("mode", "uid"), [(0o664, 0), (0o646, 0), (0o600, NOBODY)])
def test_root_runs_no_code_that_another_user_s_rover_file_names(
    rover_file: Path, record: Path, ran: list[str], monkeypatch: pytest.MonkeyPatch, mode: int, uid: int, named: str
) -> None:
    rover_file.write_text(named, encoding="utf-8")
    rover_file.chmod(mode)
    owned(monkeypatch, rover_file, uid)
    said = stop_motors(str(rover_file))
    assert ran == ["tests.daemon.left_turning:buses"], "what root's daemon drove is stopped"
    assert f"{rover_file}: rejected: it names code, or a device" in said
    record.unlink()
    with pytest.raises(BadInput, match=r"sudo -u.*chmod go-w.*; no stop is certain: switch the motors' power off"):
        stop_motors(str(rover_file))


def test_root_runs_no_code_that_another_user_s_daemon_has_recorded_and_asks_it(
    rover_file: Path, record: Path, path: Path, ran: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    owned(monkeypatch, record, NOBODY)
    asked = ask_that(monkeypatch, path, dict)
    with pytest.raises(WayfarerError, match=rf"{record}: rejected: it names code.*; the daemon at {path} says") as said:
        stop_motors(str(rover_file))
    assert (ran, said.value.exit_code, len(asked)) == ([], 1, 1)
    rover_file.write_text(THUNDERBORG, encoding="utf-8")
    with pytest.raises(WayfarerError, match="rejected: it names code") as said:
        stop_motors(str(rover_file))
    assert (ran, said.value.exit_code) == (["linux"], 1), "wheels may turn that root's file does not name"


@pytest.mark.parametrize(
    ("port", "opened"),
    [
        ("/dev/ttyUSB0", True),
        ("/dev/ttymxc0", True),
        ("/dev/tty1", False),
        ("/dev/watchdog", False),
        ("/dev/ttyUSB0/../watchdog", False),
        ("/dev/shm/ttyUSB0", False),
        ("ttyUSB0", False),
        (7, False),
    ],
)
def test_root_opens_no_device_that_another_user_has_recorded_but_one_that_motors_are_on(
    rover_file: Path, record: Path, path: Path, ran: list[str], monkeypatch: pytest.MonkeyPatch, port: object,
    opened: bool,
) -> None:  # fmt: skip
    """Opening ``/dev/watchdog`` resets the computer."""
    write_record(path, DrivenBoard({"driver": "sabertooth", "port": port}, "linux"))
    owned(monkeypatch, record, NOBODY)
    rover_file.write_text(BUSES + THUNDERBORG, encoding="utf-8")
    with pytest.raises(WayfarerError) if not opened else nullcontext():
        stop_motors(str(rover_file))
    assert ran == ["linux"] * opened + ["tests.daemon.left_turning:buses"]


def test_code_that_root_s_own_file_names_too_is_run(
    rover_file: Path, record: Path, ran: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    owned(monkeypatch, record, NOBODY)
    rover_file.write_text(BUSES + THUNDERBORG, encoding="utf-8")
    assert stop_motors(str(rover_file)) == f"the daemon's {record} and {rover_file}: stopped"
    assert ran == ["tests.daemon.left_turning:buses"]


def test_root_stops_wayfarer_s_own_driver_whoever_may_write_the_file(
    rover_file: Path, ran: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It names no code, and a stop is harmless."""
    rover_file.write_text(THUNDERBORG, encoding="utf-8")
    rover_file.chmod(0o666)
    owned(monkeypatch, rover_file, NOBODY)
    assert stop_motors(str(rover_file)).endswith("rover.toml: stopped")
    assert ran == ["linux"]


def test_code_of_a_rover_file_comes_after_what_a_daemon_drove(
    rover_file: Path, record: Path, ran: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may hang, or end the process."""
    rover_file.write_text('buses = "os:abort"\n' + THUNDERBORG, encoding="utf-8")
    stop_motors(str(rover_file))
    assert ran == ["tests.daemon.left_turning:buses", "os:abort"]
