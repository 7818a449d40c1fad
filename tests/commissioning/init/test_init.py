"""A first rover file, of four computers: what is seen, asked and written, and whether it passes ``check``."""

from __future__ import annotations

import asyncio
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.commissioning.init import rigs
from tests.loop_guard import WatchedVirtualLoop
from wayfarer.commissioning.checks import check, passed
from wayfarer.commissioning.init import first_rover_file, probe
from wayfarer.config.factory import assemble
from wayfarer.config.rover_file import RoverConfig, load_rover, parse_rover
from wayfarer.drivers.cmps14 import CMPS14
from wayfarer.drivers.gpsd import Gpsd
from wayfarer.errors import BadConfig, NotResponding

CMPS14_AT = {"bus": "/dev/i2c-1", "address": 0x60}
SEEN = {"safety": {"deadman_unproved_because": "simulated"}}


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


class Script:
    """A person who answers by key; what is not in the script is Enter alone. ``asked`` has the keys."""

    patient = True

    def __init__(self, **answers: list[str]) -> None:
        self._answers = {key.replace("__", "."): list(each) for key, each in answers.items()}
        self.asked: list[str] = []
        self.told: list[str] = []

    def say(self, text: str) -> None:
        self.told.append(text)

    def ask(self, question: str, default: str) -> str:
        key = question.rpartition("\n")[2].split(maxsplit=1)[0]
        self.asked.append(key)
        left = self._answers.get(key)
        return left.pop(0) if left else default


def written(machine: rigs.Machine, person: Script, answers: Mapping[str, Any] = SEEN) -> RoverConfig:
    return parse_rover("rover.toml", first_rover_file(machine.look(), dict(answers), person))


def passes(machine: rigs.Machine, config: RoverConfig) -> bool:
    return passed(machine.runner.run(check(config, assemble(config, machine.buses), machine.host, None)))


def test_forestrover(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine, person = rigs.forestrover(tmp_path, runner), Script()
    inventory = machine.look()
    assert [each[:2] for each in inventory.sightings] == [
        ("found", "CMPS14 firmware 7 at 0x60 on /dev/i2c-1"),
        ("nothing", "CMPS14 at 0x61 on /dev/i2c-1, nor at 6 more addresses up to 0x67"),
        ("nothing", "gpsd at 127.0.0.1:2947"),
        ("nothing", "PMW3901 on /dev/spidev0.0"),
        ("found", "PMW3901 on /dev/spidev0.1"),
        ("nothing", "ThunderBorg at 0x15 on /dev/i2c-1"),
        ("nothing", "light of ThunderBorg at 0x15 on /dev/i2c-1"),
        ("found", "serial port /dev/ttyAMA0; nothing is sent to it"),
        ("nothing", "cameras: libcamera lists none"),
        ("found", "pins: /dev/gpiochip0"),
    ]
    config = written(machine, person)
    assert person.asked == [
        "parts.motors.driver", "name", "parts.motion.height_m", "parts.motors.port", "parts.motors.address",
        "parts.contact.driver", "parts.light.driver", "parts.position.driver", "vehicle.length_m", "vehicle.width_m",
        "vehicle.track_m", "vehicle.max_speed_m_s", "escape.cruise_m_s", "safety.start_delay_s",
    ]  # fmt: skip
    assert config == shipped("forestrover", parts__motors__address=128)
    assert passes(machine, config)


def test_minirover(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine, person = rigs.minirover(tmp_path, runner), Script()
    config = written(machine, person, {})
    assert {each.name for each in machine.look().parts} == {
        "CMPS14 firmware 7 at 0x60 on /dev/i2c-1", "ThunderBorg at 0x15 on /dev/i2c-1",
        "light of ThunderBorg at 0x15 on /dev/i2c-1",
    }  # fmt: skip
    assert person.asked[:4] == ["name", "parts.motion.driver", "parts.motion.camera", "parts.motion.method"]
    assert {"board.battery_low_v", "board.battery_critical_v"} < set(person.asked)
    assert config == shipped("minirover", parts__motion__camera="0")
    assert passes(machine, config)


def shipped(name: str, **others: Any) -> RoverConfig:
    """Return a shipped rover as ``init`` names it, with the keys that it writes although they are the defaults."""
    rover = load_rover(name).model_dump(mode="json") | {"name": "my-rover"}
    if name == "forestrover":
        rover["safety"] |= SEEN["safety"]
    for key, value in others.items():
        _, part, setting = key.split("__")
        rover["parts"][part][setting] = value
    return RoverConfig.model_validate(rover)


def test_rover_of_neither(tmp_path: Path, runner: asyncio.Runner) -> None:
    """Its own body, a compass elsewhere, switches instead of a flow sensor, a board at an adapter."""
    machine = rigs.neither(tmp_path, runner)
    machine.file("/sys/bus/i2c/devices/1-0060/driver")
    person = Script(
        name=["otter"],
        parts__motion__driver=["none"],
        parts__contact__driver=["pmw3901", "bumper"],
        parts__contact__front=["none", "5"],
        vehicle__length_m=["0.9"],
        vehicle__width_m=["-1", "wide", "0.6"],
        vehicle__max_speed_m_s=["0.8"],
    )  # fmt: skip
    sightings = [f"{verdict.value} {text}" for verdict, text in machine.look().sightings]
    assert "found CMPS14 firmware 7 at 0x62 on /dev/i2c-3" in sightings
    assert "skipped CMPS14 at 0x60 on /dev/i2c-1: the kernel drives what is there" in sightings
    assert "skipped /dev/serial0: ttyAMA10, the debug connector of a Pi 5" in sightings
    config = written(machine, person)
    assert person.told == [
        "'pmw3901' is no driver for contact; a driver of another package is given as module:Class",
        "key 'parts.contact': a bumper needs the pin of at least one side: front, left, right or rear",
        "key 'vehicle.width_m' = -1.0: input should be greater than 0; allowed is above 0 to 1000",
        "key 'vehicle.width_m' = 'wide': it is no number above 0 to 1000",
    ]
    assert (config.name, config.anomaly_source) == ("otter", "contact")
    assert config.parts["compass"] == {"driver": "cmps14", "bus": "/dev/i2c-3", "address": 0x62}
    assert config.parts["motors"]["port"] == "/dev/serial/by-id/usb-FTDI_FT232R-if00-port0"
    assert config.parts["contact"] == {"driver": "bumper", "front": 5}
    vehicle, escape = config.vehicle, config.escape
    assert (vehicle.length_m, vehicle.width_m, vehicle.track_m, vehicle.max_speed_m_s) == (0.9, 0.6, 0.75, 0.8)
    assert (escape.cruise_m_s, escape.reverse_m_s, escape.probe_radius_m) == (0.24, 0.24, 1.07)
    assert config.detector.immobilised_s == 1.0
    assert config.chassis.weight_kg is None, "not that of the shipped body"


def test_empty_machine(tmp_path: Path, runner: asyncio.Runner) -> None:
    """It says what it looked for and where, and how buses are enabled; the file with defaults is ForestRover's."""
    machine = rigs.empty(tmp_path, runner)
    inventory = machine.look()
    assert inventory.is_empty
    assert {verdict.value for verdict, _ in inventory.sightings} == {"nothing"}
    assert "/dev/i2c-*: there is no I2C bus; to enable it: sudo raspi-config nonint do_i2c 0" in str(
        inventory.sightings
    )
    assert written(machine, Script()) == shipped("forestrover", parts__motors__address=128)


@pytest.mark.parametrize("rig", [rigs.forestrover, rigs.minirover, rigs.neither])
def test_looking_writes_nothing(
    rig: Callable[[Path, asyncio.Runner], rigs.Machine], tmp_path: Path, runner: asyncio.Runner
) -> None:
    """On I2C a register's number, or a ThunderBorg's request for its id (153); on SPI two registers are read."""
    machine = rig(tmp_path, runner)
    machine.look()
    for bus in ("/dev/i2c-1", "/dev/i2c-3"):
        watched = machine.buses.i2c(bus)
        assert isinstance(watched, rigs.WatchedI2C)
        assert watched.written <= {*((address, b"\0") for address in range(0x60, 0x68)), (0x15, bytes([153]))}
    for device in ("/dev/spidev0.0", "/dev/spidev0.1"):
        spi = machine.buses.spi(device)
        assert isinstance(spi, rigs.WatchedSPI)
        assert spi.sent <= {b"\x00\x00", b"\x5f\x00"}


class Eeprom:
    """Answers anything."""

    def write(self, data: bytes) -> None:
        pass

    def read(self, count: int) -> bytes:
        return bytes(range(1, count + 1))


def test_another_chip_at_an_address_is_said_and_not_taken(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine = rigs.Machine(tmp_path, runner, None, ["/dev/i2c-1"])
    for address in (0x60, 0x15):
        machine.buses.i2c("/dev/i2c-1").attach(address, Eeprom())
    inventory = machine.look()
    assert inventory.parts == []
    others = [text for verdict, text in inventory.sightings if verdict.value == "other"]
    assert [text.split(":")[0] for text in others] == [
        "CMPS14 firmware 1 at 0x60 on /dev/i2c-1",
        "ThunderBorg at 0x15 on /dev/i2c-1",
        "ThunderBorg at 0x15 on /dev/i2c-1",
    ]


def test_bus_of_a_mainboard_is_left_alone(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine = rigs.forestrover(tmp_path, runner)
    machine.file("/sys/class/i2c-dev/i2c-1/name").write_text("SMBus I801 adapter at f040\n", encoding="ascii")
    assert {each.driver for each in machine.look().parts} == {"pmw3901"}


def test_file_says_what_each_key_means_and_how_parts_were_found(tmp_path: Path, runner: asyncio.Runner) -> None:
    machine = rigs.forestrover(tmp_path, runner)
    text = first_rover_file(machine.look(), {}, Script())
    assert text.startswith("#:schema /")
    assert Path(text.split("\n")[0].split()[1]).is_file(), "an editor finds the schema"
    assert "# It answered: CMPS14 firmware 7 at 0x60 on /dev/i2c-1.\n" in text
    assert "[parts.motors]\n# Nothing has shown it yet.\n" in text
    assert "# Length of the body, with its bumpers and wheels.\nlength_m = 0.437\n" in text
    assert "address = 0x60\n" in text
    lines = text.split("\n")
    keys = [number for number, line in enumerate(lines) if " = " in line and not line.startswith(("#", "driver"))]
    assert len(keys) > 20
    assert [lines[number] for number in keys if not lines[number - 1].startswith("# ")] == []


class Hasty(Script):
    patient = False


@pytest.mark.parametrize(
    ("answers", "said"),
    [
        ("name = ''", "key 'name' = ''"),
        ("vehicle = 3", "key 'vehicle' = 3: input should be a table"),
        ("vehicle.width_m = 0", "key 'vehicle.width_m' = 0: input should be greater than 0"),
        ("vehicle.widht_m = 1", "unknown key 'vehicle.widht_m'; did you mean 'width_m'"),
        ("parts.motors.driver = 'none'", "key 'parts.motors.driver' = 'none': the rover needs this part"),
        ("parts.motors.driver = 'gpio_motors'", "key 'parts.motors.left_forward' = '': it is no whole number"),
        ("parts.motion.driver = 'cmps14'", "'cmps14' is not a driver for motion, but for compass"),
        ("parts.motors.timeout_s = 99", "key 'parts.motors.timeout_s' = 99"),
        ("parts.mototrs.driver = 'sabertooth'", "'sabertooth' is not a driver for mototrs, but for motors"),
        (r'name = "\u007f"', "not valid TOML"),
        ("parts.contact.driver = 'bumper'", "key 'parts.contact': a bumper needs the pin of at least one side"),
    ],
)
def test_answers_that_cannot_be_used(answers: str, said: str, tmp_path: Path, runner: asyncio.Runner) -> None:
    machine = rigs.empty(tmp_path, runner)
    with pytest.raises(BadConfig, match=said.replace("(", r"\(")):
        first_rover_file(machine.look(), tomllib.loads(answers), Hasty())


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
    monkeypatch.setattr(probe, "_recognised", lambda: [("careless", Careless), ("cmps14", CMPS14)])
    monkeypatch.setattr(probe, "_places", lambda driver, _: [[{}] if driver is Careless else [CMPS14_AT]])
    sightings = rigs.forestrover(tmp_path, runner).look().sightings
    assert [text for _, text in sightings[:2]] == [
        "an error in driver careless: ZeroDivisionError: no settings", "CMPS14 firmware 7 at 0x60 on /dev/i2c-1",
    ]  # fmt: skip
