"""Stopping the wheels without the daemon: whatever else is wrong, they stop, and what is not certain is said."""

from __future__ import annotations

import asyncio
import os
import pwd
import tempfile
import threading
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

import pytest

from tests.daemon.socket.fake_daemon import FakeDaemon, serve
from wayfarer import cli
from wayfarer.config.registry import find_driver
from wayfarer.daemon.motors_lock import motors_lock
from wayfarer.daemon.salvage import SHIPPED
from wayfarer.daemon.socket.client import NoDaemon
from wayfarer.daemon.socket.driven import DrivenBoard, write_record
from wayfarer.daemon.socket.protocol import Refused
from wayfarer.daemon.stop_motors import stop_motors
from wayfarer.errors import BadInput, NotResponding, WayfarerError
from wayfarer.escape.api import Vehicle
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.sabertooth import SabertoothChip
from wayfarer.simhal.chips.thunderborg import ThunderBorgChip
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

CLEARING = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ())
NOBODY = 65534
AHEAD = (1.0, 1.0)
STILL = (0.0, 0.0)
BUSES = 'buses = "tests.daemon.test_stop_motors:buses"\n'
THUNDERBORG = '[parts.motors]\ndriver = "thunderborg"\n'
SABERTOOTH = '[parts.motors]\ndriver = "sabertooth"\n'


class Bench:
    """A rover whose wheels turn though its daemon is gone; a ThunderBorg's world and a Sabertooth's."""

    def __init__(self) -> None:
        self.buses = FakeBuses()
        self.by_i2c, self.by_serial = (
            World(CLEARING, Vehicle(0.4, 0.4, 0.5, 1.4), Physics(), RandomStreams(0)) for _ in "12"
        )
        thunderborg, sabertooth = ThunderBorgChip(self.by_i2c, self.clock), SabertoothChip(self.by_serial, self.clock)
        self.buses.i2c("/dev/i2c-1").attach(0x15, thunderborg)
        self.buses.serial("/dev/serial0").chip = sabertooth
        for letter in (8, 11):
            thunderborg.write(bytes((letter, 242)))
        sabertooth.receive(bytes.fromhex("80 00 7F 7F 80 04 7F 03"))

    def clock(self) -> float:
        return 0.0


class StuckThunderBorg(ThunderBorgChip):
    """Takes every command and goes on turning."""

    def write(self, data: bytes) -> None:
        super().write(data)
        self.levels = (100, 100)


bench = Bench()


def buses() -> FakeBuses:
    return bench.buses


@pytest.fixture
def control_socket() -> Iterator[Path]:
    """A place for a daemon's socket; short, because a Unix socket's path has 107 bytes at most."""
    with TemporaryDirectory(prefix="wayfarer-", dir="/tmp") as folder:
        yield Path(folder) / "control.sock"


@pytest.fixture(autouse=True)
def own_sockets(monkeypatch: pytest.MonkeyPatch, control_socket: Path) -> None:
    """Keep away from daemons that may run on this machine."""
    monkeypatch.setattr("wayfarer.daemon.socket.paths.known_sockets", lambda: iter([control_socket]))


@pytest.fixture(autouse=True)
def fresh_bench() -> None:
    globals()["bench"] = Bench()
    assert bench.by_i2c.commanded == pytest.approx(AHEAD, abs=0.01)
    assert bench.by_serial.commanded == AHEAD


@pytest.fixture
def rover_file(tmp_path: Path) -> Path:
    return tmp_path / "rover.toml"


def stop(rover_file: Path, text: str) -> str:
    rover_file.write_text(text, encoding="utf-8")
    return stop_motors(str(rover_file))


def test_board_that_can_be_asked_says_that_the_wheels_stand_still(rover_file: Path) -> None:
    said = stop(rover_file, BUSES + THUNDERBORG)
    assert bench.by_i2c.commanded == STILL
    assert said == f"{rover_file}: ThunderBorg at 0x15 on /dev/i2c-1 says that the wheels are stopped"


def test_board_that_cannot_be_asked_is_stopped_and_nothing_is_claimed(rover_file: Path) -> None:
    said = stop(rover_file, BUSES + SABERTOOTH)
    assert bench.by_serial.commanded == STILL
    assert said == f"{rover_file}: stop was sent to Sabertooth 128 on /dev/serial0, which cannot confirm it"


def test_settings_of_the_motors_are_used(rover_file: Path) -> None:
    bench.buses.i2c("/dev/i2c-7").attach(0x16, chip := ThunderBorgChip(bench.by_i2c, bench.clock))
    chip.write(bytes((8, 200)))
    assert bench.by_i2c.commanded != STILL
    stop(rover_file, BUSES + THUNDERBORG + 'bus = "/dev/i2c-7"\naddress = 0x16\n')
    assert bench.by_i2c.commanded == STILL


@pytest.mark.parametrize(
    "broken",
    [
        "control_hz = -3\nnonsense = true\n",
        "[vehicle]\nlength_m = 0\n",
        '[parts.compass]\ndriver = "no_such_compass"\n',
        '[parts.compass]\ndriver = "cmps14"\naddress = "somewhere"\n',
        "[safety]\nstart_delay_s = nan\n",
        "[escape]\nturn_angle = 3\n",
    ],
)
def test_mistake_elsewhere_in_the_file_does_not_keep_the_wheels_turning(rover_file: Path, broken: str) -> None:
    stop(rover_file, BUSES + broken + THUNDERBORG)
    assert bench.by_i2c.commanded == STILL


def test_silent_board_is_told_with_what_to_do(rover_file: Path) -> None:
    with pytest.raises(WayfarerError) as caught:
        stop(rover_file, BUSES + THUNDERBORG + "address = 0x17\n")
    assert not isinstance(caught.value, BadInput)
    said = str(caught.value)
    assert said.startswith(f"{rover_file}: no stop was acknowledged: ")
    assert "0x17" in said
    assert said.endswith("power off")


def test_board_that_goes_on_turning_is_told_with_what_to_do(rover_file: Path) -> None:
    bench.buses.i2c("/dev/i2c-1").attach(0x16, StuckThunderBorg(bench.by_i2c, bench.clock))
    with pytest.raises(WayfarerError, match=r"was told to stop and still says .*: switch its power off"):
        stop(rover_file, BUSES + THUNDERBORG + "address = 0x16\n")


def test_mistyped_key_does_not_keep_the_wheels_turning(rover_file: Path) -> None:
    stop(rover_file, BUSES + THUNDERBORG + "adress = 0x16\n")
    assert bench.by_i2c.commanded == STILL


@pytest.mark.parametrize(
    "text", ["", "[parts.motors]\n", "parts = 3\n", "[parts]\nmotors = 3\n", '[parts.compass]\ndriver = "cmps14"\n']
)
def test_rover_without_motors_has_no_wheels_to_stop(rover_file: Path, text: str) -> None:
    with pytest.raises(BadInput, match=r"rover\.toml: no \[parts\.motors\] with a driver"):
        stop(rover_file, BUSES + text)


@pytest.mark.parametrize(
    ("text", "error", "said"),
    [
        (BUSES + THUNDERBORG + 'address = "x"\n', BadInput, r"\[parts\.motors\] cannot be used"),
        ('[parts.motors]\ndriver = "cmps14"\n', BadInput, "'cmps14' in .parts.motors. drives no motors"),
        ('[parts.motors]\ndriver = "thunderbrg"\n', BadInput, "unknown driver 'thunderbrg': did you mean thunderb"),
        ('buses = "lunix"\n' + THUNDERBORG, BadInput, "unknown buses 'lunix': did you mean linux"),
        ("a = = 3", BadInput, r"rover\.toml: not valid TOML"),
        ("a = " + "[" * 100_000, BadInput, r"rover\.toml: not valid TOML"),
        (BUSES + '[parts.motors]\ndriver = "gpio_motors"\nleft_forward = 17\n', BadInput, "missing 3 required"),
        ('buses = "os:getcwd"\n' + THUNDERBORG, BadInput, "os:getcwd gives no wayfarer.drivers.buses.Buses"),
        (
            '[parts.motors]\ndriver = "tests.daemon.test_stop_motors:Careless"\n',
            WayfarerError,
            "nothing may have been stopped",
        ),
    ],
)
def test_what_keeps_the_motors_from_being_found_is_told(
    rover_file: Path, text: str, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        stop(rover_file, text)


@pytest.mark.parametrize("name", ["no/such.toml", "nosuchrover"])
def test_rover_file_that_is_not_there_is_told(name: str) -> None:
    with pytest.raises(BadInput, match=r"no\w*.*\.toml: cannot be read: No such file"):
        stop_motors(name)


@pytest.mark.parametrize("name", ["rover.toml", "./rover"])
def test_rover_file_is_found_in_the_working_folder_and_without_a_suffix(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(BUSES + THUNDERBORG, encoding="utf-8")
    assert "are stopped" in stop_motors(name)


def test_shipped_rover_is_found_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.daemon.stop_board.make_buses", lambda name: bench.buses)
    port = tomllib.loads((SHIPPED / "forestrover.toml").read_text(encoding="utf-8"))["parts"]["motors"]["port"]
    bench.buses.serial(port).chip = bench.buses.serial("/dev/serial0").chip
    assert "Sabertooth" in stop_motors("forestrover")
    assert "ThunderBorg" in stop_motors("minirover")
    assert (bench.by_i2c.commanded, bench.by_serial.commanded) == (STILL, STILL)


# -- what a daemon recorded ------------------------------------------------------------------------------------------


@pytest.fixture
def record(control_socket: Path) -> Path:
    """What a daemon that drives the ThunderBorg left beside its socket."""
    write_record(control_socket, DrivenBoard({"driver": "thunderborg"}, "tests.daemon.test_stop_motors:buses"))
    return control_socket.with_name("motors.json")


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


@pytest.mark.parametrize("text", [None, "a = = 3", "[parts.motors]\ndriver = 'no_such'\n"])
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
    rover_file: Path, record: Path, control_socket: Path, table: str, silent: str
) -> None:
    if silent == "motors.json":
        elsewhere = DrivenBoard({"driver": "thunderborg", "address": 0x18}, "tests.daemon.test_stop_motors:buses")
        write_record(control_socket, elsewhere)
    with pytest.raises(WayfarerError) as caught:
        stop(rover_file, table)
    assert caught.value.exit_code == 1
    (failed,) = (each for each in str(caught.value).split("; ") if "no stop was acknowledged" in each)
    assert silent in failed
    assert (bench.by_serial if silent == "motors.json" else bench.by_i2c).commanded == STILL


def test_recorded_driver_that_is_gone_is_no_success(rover_file: Path, control_socket: Path) -> None:
    write_record(control_socket, DrivenBoard({"driver": "no.such:Driver"}, "linux"))
    with pytest.raises(
        WayfarerError, match=r"motors\.json: driver 'no\.such:Driver': cannot import.*are stopped"
    ) as caught:
        stop(rover_file, BUSES + THUNDERBORG)
    assert caught.value.exit_code == 1
    assert bench.by_i2c.commanded == STILL


def test_file_that_others_could_have_written_is_not_believed_and_that_is_told(rover_file: Path, record: Path) -> None:
    record.chmod(0o646)
    with pytest.raises(WayfarerError) as refused:
        stop(rover_file, BUSES + SABERTOOTH)
    assert refused.value.exit_code == 1, "what is driven may be another board than the rover file's"
    assert bench.by_i2c.commanded != STILL
    assert str(refused.value).endswith(f"; {record}: not believed: others may write to it (mode 0646); remove it")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can take another user's rights")
def test_root_stops_what_another_user_recorded_with_that_user_s_rights(
    rover_file: Path, record: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Its driver is code of that user's choice: here an interpreter that says who it is, and what it was given."""
    asked = Path(tempfile.mkdtemp(dir="/tmp")) / "python"
    asked.parent.chmod(0o755)
    asked.write_text('#!/bin/sh\necho "I am $(id -u) of $(id -G), and was given $(cat) by $*"\n', encoding="utf-8")
    asked.chmod(0o755)
    for each in (record, record.parent):
        os.chown(each, NOBODY, -1)
    monkeypatch.setattr("sys.executable", str(asked))
    only_ours = {"sabertooth": find_driver("sabertooth")}  # the other one is not imported as root
    monkeypatch.setattr("wayfarer.daemon.stop_board.find_driver", only_ours.__getitem__)
    said = stop(rover_file, BUSES + SABERTOOTH)
    account = pwd.getpwuid(NOBODY)
    groups = " ".join(map(str, sorted(os.getgrouplist(account.pw_name, account.pw_gid))))
    assert f"{record}: I am {NOBODY} of {groups}, and was given " in said
    assert said.startswith(str(rover_file)), "what needs nobody else's process is stopped first"
    assert '{"motors": {"driver": "thunderborg"}, "buses": "tests.daemon.test_stop_motors:buses"}' in said
    assert "by -P -m wayfarer.daemon.stop_board (stopped as user" in said
    monkeypatch.setattr("sys.executable", str(tmp_path / "none"))
    with pytest.raises(WayfarerError, match=rf"no process of user {NOBODY}, whose file this is, could stop them"):
        stop_motors(str(rover_file))


# -- mistakes that stopping does not need --------------------------------------------------------------------------


class Careless:
    """A third party's driver without settings."""

    part: ClassVar[str] = "motors"


@pytest.mark.parametrize(
    ("table", "left_out"),
    [
        (SABERTOOTH + "timeout_s = 30\n", "timeout_s"),
        (SABERTOOTH + 'timeout_s = "x"\nbattery_min_v = 99\nduty_limit = 0\n', "timeout_s, battery_min_v, duty_limit"),
        (THUNDERBORG + "duty_limit = 0\n", "duty_limit"),
        (THUNDERBORG + 'left = "A"\nduty_limit = nan\nreverse_left = true\n', "duty_limit"),
    ],
)
def test_value_that_does_not_say_where_the_board_is_does_not_keep_the_wheels_turning(
    rover_file: Path, table: str, left_out: str
) -> None:
    said = stop(rover_file, BUSES + table)
    assert (bench.by_serial if "sabertooth" in table else bench.by_i2c).commanded == STILL
    assert said.endswith(f"([parts.motors] {left_out}: of no use, left out)")


@pytest.mark.parametrize("where", ['address = "x"', "address = 0x1G", "bus = 3.5.1", 'address = 0x17 "'])
def test_board_is_never_looked_for_elsewhere_than_where_the_file_says(rover_file: Path, where: str) -> None:
    with pytest.raises(WayfarerError):
        stop(rover_file, BUSES + THUNDERBORG + "duty_limit = 0\n" + where)
    assert bench.by_i2c.commanded != STILL


@pytest.mark.parametrize(
    "text",
    [
        BUSES + "control_hz = = 3\n" + THUNDERBORG + "[vehicle\nlength_m = 1\n",
        BUSES + "[vehicle]\nlength_m = 0,4\n" + THUNDERBORG + "[parts.light]\nbuses = 3\ndriver = 'nope\n",
        BUSES + THUNDERBORG + 'left = "B\nduty_limit = 0,9\n[[[\n',
        BUSES + "[ parts . motors ] # both sides\ndriver = thunderborg\n",
        BUSES + "# f\xfcr \x00 den Wald\n" + THUNDERBORG,
        BUSES + THUNDERBORG + "[escape]\na = 1\na = 2\n",
    ],
)
def test_broken_line_does_not_keep_the_wheels_turning(rover_file: Path, text: str) -> None:
    rover_file.write_text(text, encoding="latin-1")
    stop_motors(str(rover_file))
    assert bench.by_i2c.commanded == STILL


def test_place_of_the_board_is_kept_from_a_broken_file(rover_file: Path) -> None:
    bench.buses.i2c("/dev/i2c-7").attach(0x16, chip := ThunderBorgChip(bench.by_i2c, bench.clock))
    chip.write(bytes((8, 200)))
    said = stop(rover_file, BUSES + THUNDERBORG + "bus = /dev/i2c-7\naddress = 0x16\n[vehicle\n")
    assert said.startswith(f"{rover_file}: ThunderBorg at 0x16 on /dev/i2c-7 says")


# -- motors that cannot be opened ----------------------------------------------------------------------------------

PINS = '[parts.motors]\ndriver = "gpio_motors"\n' + "".join(
    f"{key} = {pin}\n"
    for key, pin in (("left_forward", 17), ("left_backward", 18), ("right_forward", 22), ("right_backward", 23))
)


def test_pins_of_another_program_are_told_with_their_reason(rover_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def claim(name: str, make: object) -> None:
        raise NotResponding(f"{name}: cannot have these pins: 'GPIO busy'")

    monkeypatch.setattr("wayfarer.drivers.gpio_motors.claim", claim)
    with pytest.raises(WayfarerError) as caught:
        stop(rover_file, BUSES + PINS)
    said = str(caught.value)
    assert said.startswith(
        f"{rover_file}: no stop could be sent, switch the motors' power off: motors on GPIO 17/18 and 22/23:"
    )
    assert said.endswith("'GPIO busy'")


# -- a daemon that is still there ----------------------------------------------------------------------------------


def ask_that(monkeypatch: pytest.MonkeyPatch, control_socket: Path, answers: Callable[[], object]) -> list[object]:
    """Have somebody answer at the socket; return what it is asked."""
    asked: list[object] = []

    def ask(request: object, path: Path, timeout_s: float) -> object:
        assert path == control_socket
        assert timeout_s <= 1.0
        asked.append(request)
        return answers()

    control_socket.touch()
    monkeypatch.setattr("wayfarer.daemon.socket.client.ask", ask)
    return asked


def drive_on() -> object:
    """What a daemon that ends still had on its way."""
    assert bench.by_i2c.commanded == STILL, "the wheels are stopped before anybody is asked anything"
    chip = bench.buses.i2c("/dev/i2c-1").chip_at(0x15)
    chip.write(bytes((8, 242)))
    return {}


def test_daemon_is_asked_to_stop_and_what_it_still_sent_is_taken_back(
    rover_file: Path, monkeypatch: pytest.MonkeyPatch, control_socket: Path
) -> None:
    asked = ask_that(monkeypatch, control_socket, drive_on)
    assert "says that the wheels are stopped" in stop(rover_file, BUSES + THUNDERBORG)
    assert asked == [{"do": "stop"}]
    assert bench.by_i2c.commanded == STILL


def test_daemon_whose_socket_is_known_twice_is_asked_once(
    rover_file: Path, monkeypatch: pytest.MonkeyPatch, control_socket: Path
) -> None:
    asked = ask_that(monkeypatch, control_socket, dict)
    monkeypatch.setattr("wayfarer.daemon.socket.paths.known_sockets", lambda: iter([control_socket] * 2))
    stop(rover_file, BUSES + THUNDERBORG)
    assert asked == [{"do": "stop"}]


@pytest.mark.parametrize("error", [Refused("no"), WayfarerError("did not answer within 1 s")])
def test_daemon_that_does_not_agree_is_no_assurance(
    rover_file: Path, monkeypatch: pytest.MonkeyPatch, control_socket: Path, error: Exception
) -> None:
    def answers() -> None:
        drive_on()
        raise error

    ask_that(monkeypatch, control_socket, answers)
    with pytest.raises(WayfarerError, match=r"stop was sent, but .*control\.sock still commands these wheels: end it"):
        stop(rover_file, BUSES + THUNDERBORG)
    assert bench.by_i2c.commanded == STILL


def test_daemon_of_another_user_is_found_by_its_lock(rover_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ends = os.openpty()
    port = os.ttyname(ends[1])
    bench.buses.serial(port).chip = bench.buses.serial("/dev/serial0").chip
    monkeypatch.setattr("wayfarer.daemon.stop_board.make_buses", lambda name: bench.buses)
    table = SABERTOOTH + f'port = "{port}"\n'
    who = rf"another wayfarer \(process {os.getpid()}\)"
    with motors_lock(port), pytest.raises(WayfarerError, match=f"stop was sent, but {who} still commands these wheels"):
        stop(rover_file, table)
    assert bench.by_serial.commanded == STILL
    assert "stop was sent to" in stop(rover_file, table)
    for end in ends:
        os.close(end)


@pytest.mark.parametrize("left_behind", [False, True])
def test_without_a_daemon_nothing_is_waited_for(
    rover_file: Path, monkeypatch: pytest.MonkeyPatch, control_socket: Path, left_behind: bool
) -> None:
    def nobody() -> None:
        raise NoDaemon("nobody listens")

    if left_behind:
        ask_that(monkeypatch, control_socket, nobody)
    monkeypatch.setattr("asyncio.sleep", lambda _: pytest.fail("it waits"))
    assert "are stopped" in stop(rover_file, BUSES + THUNDERBORG)


def test_real_control_socket_is_told_to_stop(rover_file: Path, control_socket: Path) -> None:
    told: list[tuple[object, ...]] = []
    ready, over = threading.Event(), threading.Event()

    async def listen() -> None:
        daemon = FakeDaemon()
        async with serve(daemon, control_socket):
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
        ("", 2, "", "this rover has no wheels to stop\n"),
    ],
    ids=["stopped", "silent board", "no motors"],
)
def test_command_says_in_one_line_and_by_its_exit_code_whether_the_wheels_stand_still(
    capsys: pytest.CaptureFixture[str], rover_file: Path, table: str, code: int, out: str, err: str
) -> None:
    rover_file.write_text(BUSES + table, encoding="utf-8")
    assert cli.run(["stop-motors", "--config", str(rover_file)]) == code
    captured = capsys.readouterr()
    for said, expected in ((captured.out, out), (captured.err, err)):
        assert said.endswith(expected)
        assert said.count("\n") == (1 if expected else 0)


def test_command_without_any_rover_file_says_what_to_name(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("wayfarer.cli.rover.ROVER_FILE", tmp_path / "none.toml")
    assert cli.run(["stop-motors"]) == 2
    assert "name one with --config" in capsys.readouterr().err


def test_file_of_the_system_is_stopped_without_being_named(monkeypatch: pytest.MonkeyPatch, rover_file: Path) -> None:
    rover_file.write_text(BUSES + SABERTOOTH, encoding="utf-8")
    monkeypatch.setattr("wayfarer.cli.rover.ROVER_FILE", rover_file)
    assert cli.run(["stop-motors"]) == 0
    assert bench.by_serial.commanded == STILL
