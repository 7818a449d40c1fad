"""Parts that cannot share a wire are refused when the rover file is read, whatever the buses are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest

from tests.config.rover_texts import complaint, load, rover_toml
from tests.conftest import Run, refusal
from wayfarer.drivers.buses import Buses
from wayfarer.drivers.thunderborg import ThunderBorg

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


OWN = '"tests.config.test_wiring:OwnThunderBorg"'
HAS_IT = (
    " has this address on /dev/i2c-1 already; correct the one that is wrong (i2cdetect shows which addresses answer), "
    "or set another on the chip"
)


def text(*tables: str, buses: str = "") -> str:
    return rover_toml(buses, "".join(tables))


@pytest.mark.parametrize("buses", ["", 'buses = "somebody.elses:buses"'], ids=["linux", "third party"])
@pytest.mark.parametrize(
    ("tables", "said"),
    [
        (
            (COMPASS, SABERTOOTH.format("/dev/../dev//i2c-1")),
            "key 'parts.motors.port' = '/dev/../dev//i2c-1': a serial port here and an I2C bus for "
            "'parts.compass.bus'; correct one of them (line 14)",
        ),
        (
            (SABERTOOTH.format("/dev/serial0"), FLOW.format("/dev/serial0")),
            "key 'parts.motion.bus' = '/dev/serial0': an SPI device here and a serial port for 'parts.motors.port'; "
            "correct one of them (line 13)",
        ),
        (
            (COMPASS, BUMPER + 'raises = true\nport = "/dev/i2c-1"\n'),  # also a driver that fails without a bus
            "key 'parts.contact.port' = '/dev/i2c-1': a serial port here and an I2C bus for 'parts.compass.bus'; "
            "correct one of them (line 15)",
        ),
        (
            (SABERTOOTH.format(""),),
            "key 'parts.motors.port' = '': names no device; it needs a serial port, such as /dev/... (line 10)",
        ),
        (
            (COMPASS, THUNDERBORG.format("0x60")),  # motor commands would go to the compass
            f"key 'parts.motors.address' = 0x60: parts.compass (CMPS14){HAS_IT} (line 15)",
        ),
        (
            (COMPASS, THUNDERBORG.format("0x15"), LIGHT.format("0x60")),
            f"key 'parts.light.address' = 0x60: parts.compass (CMPS14){HAS_IT} (line 18)",
        ),
        (
            (SABERTOOTH.format("/dev/serial0"), BUMPER),
            "key 'parts.contact.port' = '/dev/serial0': parts.motors (Sabertooth) is on it already; "
            "two chips cannot share a serial port (line 11)",
        ),
    ],
)
def test_parts_that_cannot_share_a_wire_are_told_with_the_key_to_correct(
    tmp_path: Path, tables: tuple[str, ...], said: str, buses: str
) -> None:
    assert complaint(tmp_path, text(*tables, buses=buses)) == said


@pytest.mark.parametrize(
    "tables",
    [
        (COMPASS.replace("i2c-1", "i2c-3"), THUNDERBORG.format("0x60")),  # one address on two buses
        (COMPASS, THUNDERBORG.format("0x15"), LIGHT.format("0x15")),  # motors and light of one board
        (COMPASS, THUNDERBORG.format("0x15").replace('"thunderborg"', OWN), LIGHT.format("0x15")),
        (COMPASS, BUMPER + "raises = true\n"),
    ],
)
def test_parts_that_can_share_a_wire_are_accepted(tmp_path: Path, tables: tuple[str, ...]) -> None:
    assert load(tmp_path, text(*tables))


@pytest.mark.parametrize("command", [["run", "--rover"], ["run", "--sim", "--rover"], ["check", "--rover"],
                                     ["sim", "--depth", "bus", "--rover"]])  # fmt: skip
def test_every_command_refuses_such_a_rover_in_one_line(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]
) -> None:
    monkeypatch.setattr("wayfarer.daemon.daemon.serve", lambda _: pytest.fail("a daemon was started"))
    path = tmp_path / "rover.toml"
    path.write_text(text(COMPASS, SABERTOOTH.format("/dev/i2c-1")), encoding="utf-8")
    assert refusal(run, *command, path).startswith(f"wayfarer: {path}: key 'parts.motors.port'")
