"""Stopping one board from a rover file: mistakes elsewhere do not matter; what is uncertain is said."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests.daemon.left_turning import BUSES, SABERTOOTH, STILL, THUNDERBORG, StuckThunderBorg, bench, stop
from wayfarer.config.rover_path import SHIPPED
from wayfarer.daemon.stop_motors import stop_motors
from wayfarer.drivers.gpio import GpioPart
from wayfarer.errors import BadInput, NotResponding, WayfarerError
from wayfarer.simhal.chips.motor_boards import ThunderBorgChip

pytestmark = pytest.mark.usefixtures("left_turning")


def test_board_that_can_be_asked_says_that_the_wheels_stand_still(rover_file: Path) -> None:
    said = stop(rover_file, BUSES + THUNDERBORG)
    assert bench.by_i2c.commanded == STILL
    assert said == f"{rover_file}: ThunderBorg at 0x15 on /dev/i2c-1 says that the wheels are stopped"


def test_board_that_cannot_be_asked_is_stopped_and_nothing_is_claimed(rover_file: Path) -> None:
    said = stop(rover_file, BUSES + SABERTOOTH)
    assert bench.by_serial.commanded == STILL
    assert said == f"{rover_file}: stop was sent to Sabertooth 128 on /dev/serial0, which cannot confirm it"


def test_board_is_looked_for_where_the_file_says(rover_file: Path) -> None:
    bench.buses.i2c("/dev/i2c-7").attach(0x16, chip := ThunderBorgChip(bench.by_i2c, bench.clock))
    chip.write(bytes((8, 200)))
    said = stop(rover_file, BUSES + THUNDERBORG + 'bus = "/dev/i2c-7"\naddress = 0x16\n')
    assert bench.by_i2c.commanded == STILL
    assert said.startswith(f"{rover_file}: ThunderBorg at 0x16 on /dev/i2c-7 says")


@pytest.mark.parametrize(
    "text",
    [
        BUSES + "control_hz = -3\nnonsense = true\n" + THUNDERBORG,
        BUSES + "[vehicle]\nlength_m = 0\n" + THUNDERBORG,
        BUSES + '[parts.compass]\ndriver = "no_such_compass"\n' + THUNDERBORG,
        BUSES + '[parts.compass]\ndriver = "cmps14"\naddress = "somewhere"\n' + THUNDERBORG,
        BUSES + "[safety]\nstart_delay_s = nan\n" + THUNDERBORG,
        BUSES + "[escape]\nturn_angle = 3\n" + THUNDERBORG,
        BUSES + THUNDERBORG + "adress = 0x16\n",
    ],
)
def test_mistake_elsewhere_does_not_keep_the_wheels_turning(rover_file: Path, text: str) -> None:
    stop(rover_file, text)
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
    with pytest.raises(WayfarerError, match=r"was commanded to stop and still says .*: switch its power off"):
        stop(rover_file, BUSES + THUNDERBORG + "address = 0x16\n")


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
        ('buses = "lunix"\n' + THUNDERBORG, BadInput, "unknown buses 'lunix': .*linux"),
        ("a = = 3", BadInput, r"rover\.toml: not valid TOML"),
        ("a = " + "[" * 100_000, BadInput, r"rover\.toml: not valid TOML"),
        (
            BUSES + '[parts.motors]\ndriver = "gpio_motors"\nleft_forward = 17\n',
            BadInput,
            "needs the same pins",
        ),
        ('buses = "os:getcwd"\n' + THUNDERBORG, BadInput, "os:getcwd does not give a wayfarer.drivers.buses.Buses"),
        (
            '[parts.motors]\ndriver = "tests.daemon.left_turning:Careless"\n',
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
    monkeypatch.setattr("wayfarer.daemon.stop_motors.make_buses", lambda name: bench.buses)
    port = tomllib.loads((SHIPPED / "forestrover.toml").read_text(encoding="utf-8"))["parts"]["motors"]["port"]
    chip = bench.buses.serial("/dev/serial0").chip
    assert chip is not None
    bench.buses.serial(port).attach(chip)
    assert "Sabertooth" in stop_motors("forestrover")
    assert "ThunderBorg" in stop_motors("minirover")
    assert (bench.by_i2c.commanded, bench.by_serial.commanded) == (STILL, STILL)


# -- a broken rover file -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (BUSES + "control_hz = = 3\n" + THUNDERBORG, "not valid TOML"),
        (BUSES + THUNDERBORG + "[vehicle\n", "not valid TOML"),
        (BUSES + THUNDERBORG + "[escape]\na = 1\na = 2\n", "not valid TOML"),
        (BUSES + "# f\xfcr den Wald\n" + THUNDERBORG, "not valid TOML: UnicodeDecodeError"),
        (BUSES + SABERTOOTH + "timeout_s = 30\n", r"\[parts\.motors\] cannot be used"),
        (BUSES + THUNDERBORG + "duty_limit = nan\n", r"\[parts\.motors\] cannot be used"),
    ],
)
def test_broken_rover_file_without_a_record_is_refused_in_one_line(rover_file: Path, text: str, why: str) -> None:
    rover_file.write_text(text, encoding="latin-1")
    with pytest.raises(BadInput, match=rf"rover\.toml: {why}") as refused:
        stop_motors(str(rover_file))
    assert "\n" not in str(refused.value)
    assert str(refused.value).endswith("; no stop is certain: switch the motors' power off")


@pytest.mark.parametrize("where", ['address = "x"', "address = 0x1G", "bus = 3.5.1", 'address = 0x17 "'])
def test_board_is_never_looked_for_elsewhere_than_where_the_file_says(rover_file: Path, where: str) -> None:
    with pytest.raises(WayfarerError):
        stop(rover_file, BUSES + THUNDERBORG + "duty_limit = 0\n" + where)
    assert bench.by_i2c.commanded != STILL


# -- motors that cannot be opened ----------------------------------------------------------------------------------

PINS = '[parts.motors]\ndriver = "gpio_motors"\n' + "".join(
    f"{key} = {pin}\n"
    for key, pin in (("left_forward", 17), ("left_backward", 18), ("right_forward", 22), ("right_backward", 23))
)


def test_pins_of_another_program_are_told_with_their_reason(rover_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def claim(part: GpioPart) -> None:
        raise NotResponding(f"{part.name}: cannot have these pins: 'GPIO busy'")

    monkeypatch.setattr(GpioPart, "_claim", claim)
    with pytest.raises(WayfarerError) as caught:
        stop(rover_file, BUSES + PINS)
    said = str(caught.value)
    assert said.startswith(
        f"{rover_file}: no stop could be sent, switch the motors' power off: motors on GPIO 17/18 and 22/23:"
    )
    assert said.endswith("'GPIO busy'")
