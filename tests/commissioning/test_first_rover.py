"""A first rover file, of four computers: what is seen, which shipped file is copied, whether it passes ``check``."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.commissioning import computers
from tests.loop_guard import WatchedVirtualLoop
from wayfarer.commissioning import first_rover
from wayfarer.commissioning.checks import HostEnvironment, check, passed
from wayfarer.commissioning.first_rover import MODELS, FoundPart, Inventory, Model, first_rover_file, look, nearest
from wayfarer.config.factory import UNCALIBRATED, assemble
from wayfarer.config.rover_file import RoverConfig, laid_over, load_rover, parse_rover, rover_text
from wayfarer.drivers.cmps14 import CMPS14
from wayfarer.drivers.gpsd import Gpsd
from wayfarer.drivers.linux import LinuxBuses
from wayfarer.errors import BadConfig, NotResponding

PMW3901 = FoundPart("pmw3901", {"bus": "/dev/spidev0.0"}, "PMW3901 on /dev/spidev0.0")


@pytest.fixture(autouse=True)
def no_gpsd(monkeypatch: pytest.MonkeyPatch) -> None:
    """This computer may have one."""

    async def identify(driver: Gpsd) -> None:
        raise NotResponding(driver.name)

    monkeypatch.setattr(Gpsd, "identify", identify)


@pytest.fixture
def runner() -> Iterator[asyncio.Runner]:
    """Runs everything of a test on one virtual clock."""
    with asyncio.Runner(loop_factory=WatchedVirtualLoop) as runner:
        yield runner


def written(found: Inventory, model: Model | None = None) -> RoverConfig:
    return parse_rover("rover.toml", first_rover_file("otter", model or nearest(found), found))


def shipped(name: str, **parts: dict[str, Any]) -> RoverConfig:
    """A shipped rover with another name, and some settings of its parts changed."""
    return laid_over(load_rover(name), {"name": "otter", "parts": parts})


def passes(machine: computers.Machine, config: RoverConfig) -> bool:
    seen = laid_over(config, {"safety": {"deadman_unproved_because": "simulated"}})
    return passed(machine.runner.run(check(seen, assemble(seen, machine.buses), machine.host, UNCALIBRATED, None)))


def test_forestrover(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine = computers.forestrover(tmp_path, runner)
    found = machine.look()
    assert found.seen == [
        ("nothing", "BNO055 at 0x28 on /dev/i2c-1, nor at 0x29"),
        ("found", "CMPS14 firmware 7 at 0x60 on /dev/i2c-1"),
        ("nothing", "CMPS14 at 0x61 on /dev/i2c-1, nor at 6 more addresses up to 0x67"),
        ("nothing", "gpsd at 127.0.0.1:2947"),
        ("nothing", "PMW3901 on /dev/spidev0.0"),
        ("found", "PMW3901 on /dev/spidev0.1"),
        ("nothing", "ThunderBorg at 0x15 on /dev/i2c-1"),
        ("nothing", "light of ThunderBorg at 0x15 on /dev/i2c-1"),
        ("found", "serial port /dev/ttyAMA0; nothing is sent to it"),
        ("nothing", "cameras: libcamera lists none"),
    ]
    config = written(found)
    assert config == shipped("forestrover")
    assert passes(machine, config)


def test_minirover(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine = computers.minirover(tmp_path, runner)
    found = machine.look()
    assert {each.name for each in found.parts.values()} == {
        "CMPS14 firmware 7 at 0x60 on /dev/i2c-1", "ThunderBorg at 0x15 on /dev/i2c-1",
        "light of ThunderBorg at 0x15 on /dev/i2c-1",
    }  # fmt: skip
    config = written(found)
    assert config == shipped("minirover")
    assert passes(machine, config)
    assert "# FILL IN: which camera, if not the first. Cameras here: imx219\n" in first_rover_file(
        "otter", "minirover", found
    )


def test_rover_of_neither_has_its_parts_where_they_were_found(tmp_path: Path, runner: asyncio.Runner) -> None:
    """A compass elsewhere, a board at an adapter, and no flow sensor: the first shipped rover is as near as any."""
    machine = computers.neither(tmp_path, runner)
    machine.file("/sys/bus/i2c/devices/1-0060/driver")
    found = machine.look()
    assert ("found", "CMPS14 firmware 7 at 0x62 on /dev/i2c-3") in found.seen
    assert ("skipped", "CMPS14 at 0x60 on /dev/i2c-1: the kernel drives what is there") in found.seen
    assert ("skipped", "/dev/serial0: ttyAMA10, the debug connector of a Pi 5") in found.seen
    port = "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0"
    assert written(found) == shipped(
        "forestrover", compass={"bus": "/dev/i2c-3", "address": 0x62}, motors={"port": port}
    )
    text = first_rover_file("otter", "forestrover", found)
    assert f"nothing is sent to a port to find out. Ports here: {port}\n" in text
    assert 'A rover without motion sensor needs anomaly_source = "contact"' in text


def test_roboclaw_at_usb_is_known_by_its_port_s_name_and_nothing_is_sent_to_it(
    tmp_path: Path, runner: asyncio.Runner
) -> None:
    machine = computers.empty(tmp_path, runner)
    port = "/dev/serial/by-id/usb-03eb_USB_Roboclaw_2x30A-if00"
    machine.file(port)
    found = machine.look()
    assert ("found", f"serial port {port}; nothing is sent to it") in found.seen
    assert written(found).parts["motors"] == {"driver": "roboclaw", "port": port}


def test_empty_machine(tmp_path: Path, runner: asyncio.Runner) -> None:
    """It says what it looked for and where, and how buses are enabled; the file is ForestRover's."""
    found = computers.empty(tmp_path, runner).look()
    assert {verdict for verdict, _ in found.seen} == {"nothing"}
    assert "/dev/i2c-*: there is no I2C bus; to enable it: sudo raspi-config nonint do_i2c 0" in str(found.seen)
    assert written(found) == shipped("forestrover")


@pytest.mark.parametrize("model", MODELS)
def test_comments_of_the_shipped_file_stay_and_what_a_person_must_know_is_marked(model: Model) -> None:
    text = first_rover_file("otter", model, Inventory())
    lines = text.rstrip("\n").split("\n")
    assert lines[0].startswith("#:schema /")
    assert Path(lines[0].split()[1]).is_file(), "an editor finds the schema"
    before = rover_text(model).rstrip("\n").split("\n")[5:]
    added = [line for line in lines[5:] if line not in before]
    assert [line for line in lines[5:] if line not in added] == before, "nothing else is changed"
    assert all(line.startswith("# FILL IN: ") for line in added)
    assert len(added) == 3 + len(load_rover(model).parts)


@pytest.mark.parametrize("model", MODELS)
def test_part_of_another_shipped_rover_comes_with_its_own_table(model: Model) -> None:
    found = Inventory(parts={"motion": PMW3901})
    text = first_rover_file("otter", model, found)
    assert "# Found: PMW3901 on /dev/spidev0.0\n" in text
    assert 'bus = "/dev/spidev0.0" # the breakout' in text, "what a comment says of a line stays"
    motion = load_rover("forestrover").parts["motion"] | {"bus": "/dev/spidev0.0"}
    assert written(found, model).parts["motion"] == motion
    assert ("camera_motion" in text) is False


def test_part_that_no_shipped_rover_has_gets_a_table_of_its_own_in_place_of_one_that_is_commented_out() -> None:
    found = Inventory(parts={"position": FoundPart("gpsd", {}, "gpsd at 127.0.0.1:2947")})
    text = first_rover_file("otter", "minirover", found)
    assert text.count("[parts.position]") == 1
    assert written(found, "minirover").parts["position"] == {"driver": "gpsd"}


def test_shipped_rover_most_of_whose_parts_answer_is_the_nearest() -> None:
    board = FoundPart("thunderborg", {"bus": "/dev/i2c-1", "address": 0x15}, "ThunderBorg")
    compass = FoundPart("cmps14", {}, "CMPS14")
    assert nearest(Inventory()) == "forestrover"
    assert nearest(Inventory(parts={"compass": compass, "motors": board})) == "minirover"
    assert nearest(Inventory(parts={"compass": compass}, cameras=["imx219"])) == "minirover"
    assert nearest(Inventory(parts={"motion": PMW3901}, cameras=["imx219"])) == "forestrover"


def test_name_that_a_rover_file_cannot_have_is_refused() -> None:
    with pytest.raises(BadConfig, match="key 'name'"):
        first_rover_file("o" * 41, "forestrover", Inventory())
    with pytest.raises(BadConfig, match="not valid TOML"):
        first_rover_file("\x7f", "forestrover", Inventory())


@pytest.mark.parametrize("rig", [computers.forestrover, computers.minirover, computers.neither])
def test_looking_writes_nothing(
    rig: Callable[[Path, asyncio.Runner], computers.Machine], tmp_path: Path, runner: asyncio.Runner
) -> None:
    """On I2C a register's number, or a ThunderBorg's request for its id (153); on SPI two registers are read."""
    machine = rig(tmp_path, runner)
    machine.look()
    for bus in ("/dev/i2c-1", "/dev/i2c-3"):
        watched = machine.buses.i2c(bus)
        assert isinstance(watched, computers.WatchedI2C)
        compasses = {(address, b"\0") for address in (0x28, 0x29, *range(0x60, 0x68))}
        assert watched.written <= compasses | {(0x15, bytes([153]))}
    for device in ("/dev/spidev0.0", "/dev/spidev0.1"):
        spi = machine.buses.spi(device)
        assert isinstance(spi, computers.WatchedSPI)
        assert spi.sent <= {b"\x00\x00", b"\x5f\x00"}


class Eeprom:
    """Answers anything."""

    def write(self, data: bytes) -> None:
        pass

    def read(self, count: int) -> bytes:
        return bytes(range(1, count + 1))


def test_another_chip_at_an_address_is_said_and_not_taken(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine = computers.Machine(tmp_path, runner, None, ["/dev/i2c-1"])
    for address in (0x60, 0x15):
        machine.buses.i2c("/dev/i2c-1").attach(address, Eeprom())
    found = machine.look()
    assert found.parts == {}
    others = [text for verdict, text in found.seen if verdict == "other"]
    assert [text.split(":")[0] for text in others] == [
        "CMPS14 firmware 1 at 0x60 on /dev/i2c-1",
        "ThunderBorg at 0x15 on /dev/i2c-1",
        "ThunderBorg at 0x15 on /dev/i2c-1",
    ]


def test_bus_of_a_mainboard_is_left_alone(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine = computers.forestrover(tmp_path, runner)
    machine.file("/sys/class/i2c-dev/i2c-1/name").write_text("SMBus I801 adapter at f040\n", encoding="ascii")
    assert {each.driver for each in machine.look().parts.values()} == {"pmw3901"}


async def test_missing_library_is_told_once_for_each_bus_and_no_part_is_called_silent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    host, buses = HostEnvironment(tmp_path, tmp_path / "calibration.json", (), 1.8e9, tmp_path), LinuxBuses()
    for device in computers.HEADER:
        host.path(device).parent.mkdir(exist_ok=True)
        host.path(device).touch()
    for library in ("smbus2", "spidev"):
        monkeypatch.setitem(sys.modules, library, None)
    try:
        seen = (await look(host, buses, list)).seen
    finally:
        await buses.close()
    on_buses = [each for each in seen if "/dev/i2c-1" in each[1] or "/dev/spidev0." in each[1]]
    assert {verdict for verdict, _ in on_buses} == {"skipped"}
    assert len(on_buses) == 3, "one I2C bus, two SPI devices"
    assert all("is not installed; pip install" in text for _, text in on_buses)


class Careless:
    """A third party's driver whose code is broken."""

    part, name = "light", "careless"

    @dataclass(frozen=True)
    class Settings:
        pass

    def __init__(self, settings: object, buses: object) -> None:
        raise ZeroDivisionError("no settings")

    async def open(self) -> None: ...

    async def close(self) -> None: ...

    async def identify(self) -> None: ...


def test_driver_that_cannot_be_made_is_noted_and_the_others_are_asked(
    tmp_path: Path, runner: asyncio.Runner, monkeypatch: pytest.MonkeyPatch
) -> None:
    drivers = {"careless": Careless, "cmps14": CMPS14}
    monkeypatch.setattr(first_rover, "driver_names", lambda: list(drivers))
    monkeypatch.setattr(first_rover, "find_driver", drivers.__getitem__)
    seen = computers.forestrover(tmp_path, runner).look().seen
    assert [text for _, text in seen[:2]] == [
        "an error in driver careless: ZeroDivisionError: no settings", "CMPS14 firmware 7 at 0x60 on /dev/i2c-1",
    ]  # fmt: skip
