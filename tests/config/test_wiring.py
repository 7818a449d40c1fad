"""Parts that cannot share a wire are refused when the rover file is read, whatever the buses are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest

from wayfarer import cli
from wayfarer.config.rover_file import RoverConfig, load_rover, rover_names
from wayfarer.drivers.buses import Buses
from wayfarer.drivers.thunderborg import ThunderBorg
from wayfarer.errors import BadConfig

TOP = 'name = "test"\n{buses}[vehicle]\nlength_m = 0.4\nwidth_m = 0.4\ntrack_m = 0.5\nmax_speed_m_s = 1.4\n'
COMPASS = '[parts.compass]\ndriver = "cmps14"\nbus = "/dev/i2c-1"\naddress = 0x60\n'
THUNDERBORG = '[parts.motors]\ndriver = "thunderborg"\nbus = "/dev/i2c-1"\naddress = {}\n'
LIGHT = '[parts.light]\ndriver = "thunderborg_light"\naddress = {}\n'
FLOW = '[parts.motion]\ndriver = "pmw3901"\nbus = "{}"\n'


@dataclass(frozen=True, slots=True)
class PortSettings:
    """Where a third party's part is."""

    port: str = "/dev/serial0"
    raises: bool = False


class SerialBumper:
    """A third party's bumper at a serial port: nobody told wayfarer about it."""

    part: ClassVar[str] = "contact"
    Settings = PortSettings

    def __init__(self, settings: PortSettings, buses: Buses) -> None:
        self.port = buses.serial(settings.port, baud=9600)
        if settings.raises:
            raise OSError("no real port")


class OwnThunderBorg(ThunderBorg):
    """A third party's driver of a board that wayfarer knows."""


BUMPER = '[parts.contact]\ndriver = "tests.config.test_wiring:SerialBumper"\n'
SABERTOOTH = '[parts.motors]\ndriver = "sabertooth"\nport = "{}"\n'


def loaded(folder: Path, *tables: str, buses: str = "") -> RoverConfig:
    path = folder / "rover.toml"
    path.write_text(TOP.format(buses=buses) + "".join(tables), encoding="utf-8")
    return load_rover(str(path))


def complaint(folder: Path, *tables: str, buses: str = "") -> str:
    with pytest.raises(BadConfig) as caught:
        loaded(folder, *tables, buses=buses)
    said = str(caught.value)
    assert "\n" not in said
    return said.removeprefix(f"{folder}/rover.toml: ")


@pytest.mark.parametrize("buses", ["", 'buses = "somebody.elses:buses"\n'], ids=["linux", "third party"])
def test_one_device_for_two_kinds_of_bus_is_refused_for_any_buses(tmp_path: Path, buses: str) -> None:
    said = complaint(tmp_path, COMPASS, SABERTOOTH.format("/dev/i2c-1"), buses=buses)
    line = 14 if buses else 13
    assert said == (
        "key 'parts.motors.port' = '/dev/i2c-1': a serial port here and an I2C bus for 'parts.compass.bus'; "
        f"correct one of them (line {line})"
    )


def test_one_device_that_is_written_in_two_ways_is_refused(tmp_path: Path) -> None:
    said = complaint(tmp_path, COMPASS, SABERTOOTH.format("/dev/../dev//i2c-1"))
    assert said.startswith("key 'parts.motors.port' = '/dev/../dev//i2c-1': a serial port here and an I2C bus for")


def test_part_without_a_device_is_refused(tmp_path: Path) -> None:
    said = complaint(tmp_path, SABERTOOTH.format(""))
    assert said == "key 'parts.motors.port' = '': names no device; it needs a serial port, such as /dev/... (line 9)"


def test_flow_sensor_on_the_serial_port_of_the_motors_is_refused(tmp_path: Path) -> None:
    said = complaint(tmp_path, SABERTOOTH.format("/dev/serial0"), FLOW.format("/dev/serial0"))
    assert said.startswith("key 'parts.motion.bus' = '/dev/serial0': an SPI device here and a serial port for")


def test_driver_of_a_third_party_is_held_to_the_same(tmp_path: Path) -> None:
    said = complaint(tmp_path, COMPASS, BUMPER + 'port = "/dev/i2c-1"\n')
    assert said.startswith("key 'parts.contact.port' = '/dev/i2c-1': a serial port here and an I2C bus for 'parts.comp")


def test_what_a_driver_asked_for_before_it_failed_without_a_real_bus_counts(tmp_path: Path) -> None:
    assert complaint(tmp_path, COMPASS, BUMPER + 'raises = true\nport = "/dev/i2c-1"\n')
    assert loaded(tmp_path, COMPASS, BUMPER + "raises = true\n")


def test_two_chips_at_one_address_are_refused(tmp_path: Path) -> None:
    """Motor commands would go to the compass."""
    said = complaint(tmp_path, COMPASS, THUNDERBORG.format("0x60"))
    assert said.startswith(
        "key 'parts.motors.address' = 0x60: parts.compass (CMPS14) has this address on /dev/i2c-1 already; correct"
    )
    assert said.endswith("(line 14)")


def test_address_that_the_file_leaves_out_is_told_by_its_part(tmp_path: Path) -> None:
    said = complaint(tmp_path, THUNDERBORG.format("0x60"), COMPASS.replace("address = 0x60\n", ""))
    assert said.startswith("key 'parts.compass.address' = 0x60: parts.motors (ThunderBorg) has this address")
    assert said.endswith("(line 11)")


def test_one_address_on_two_buses_is_no_clash(tmp_path: Path) -> None:
    assert loaded(tmp_path, COMPASS.replace("i2c-1", "i2c-3"), THUNDERBORG.format("0x60"))


def test_motors_and_light_of_one_board_share_it(tmp_path: Path) -> None:
    assert loaded(tmp_path, COMPASS, THUNDERBORG.format("0x15"), LIGHT.format("0x15"))
    own = THUNDERBORG.format("0x15").replace('"thunderborg"', '"tests.config.test_wiring:OwnThunderBorg"')
    assert loaded(tmp_path, COMPASS, own, LIGHT.format("0x15"))


def test_light_at_the_address_of_the_compass_is_refused(tmp_path: Path) -> None:
    said = complaint(tmp_path, COMPASS, THUNDERBORG.format("0x15"), LIGHT.format("0x60"))
    assert said.startswith("key 'parts.light.address' = 0x60: parts.compass (CMPS14)")


def test_two_chips_on_one_serial_port_are_refused(tmp_path: Path) -> None:
    said = complaint(tmp_path, SABERTOOTH.format("/dev/serial0"), BUMPER)
    assert said == (
        "key 'parts.contact.port' = '/dev/serial0': parts.motors (Sabertooth) is on it already; "
        "two chips cannot share a serial port (line 10)"
    )


@pytest.mark.parametrize("name", rover_names())
def test_shipped_rovers_have_a_wire_for_each_chip(name: str) -> None:
    assert load_rover(name).parts


@pytest.mark.parametrize("command", [["run", "--config"], ["run", "--sim", "--config"], ["check", "--config"],
                                     ["sim", "--depth", "bus", "--rover"], ["faults", "--rover"]])  # fmt: skip
def test_every_command_refuses_such_a_rover_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, command: list[str]
) -> None:
    monkeypatch.setattr("wayfarer.daemon.daemon.serve", lambda _: pytest.fail("a daemon was started"))
    path = tmp_path / "rover.toml"
    path.write_text(TOP.format(buses="") + COMPASS + SABERTOOTH.format("/dev/i2c-1"), encoding="utf-8")
    assert cli.run([*command, str(path)]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith(f"wayfarer: {path}: key 'parts.motors.port'")
