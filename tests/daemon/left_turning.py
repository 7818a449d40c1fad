"""A rover whose wheels turn though its daemon is gone, for the tests of what stops them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tests.simhal.clearing import steady_world
from wayfarer.daemon.stop_motors import stop_motors
from wayfarer.drivers.thunderborg import ThunderBorg
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chips.motor_boards import SabertoothChip, ThunderBorgChip

AHEAD = (1.0, 1.0)
STILL = (0.0, 0.0)
BUSES = 'buses = "tests.daemon.left_turning:buses"\n'
THUNDERBORG = '[parts.motors]\ndriver = "thunderborg"\n'
SABERTOOTH = '[parts.motors]\ndriver = "sabertooth"\n'


class Bench:
    """A rover whose wheels turn though its daemon is gone; a ThunderBorg's world and a Sabertooth's."""

    def reset(self) -> None:
        self.buses = FakeBuses()
        self.by_i2c, self.by_serial = steady_world(), steady_world()
        thunderborg, sabertooth = ThunderBorgChip(self.by_i2c, self.clock), SabertoothChip(self.by_serial, self.clock)
        self.buses.i2c("/dev/i2c-1").attach(0x15, thunderborg)
        self.buses.serial("/dev/serial0").attach(sabertooth)
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


class Careless(ThunderBorg):
    """A third party's driver that takes no settings as they are."""

    @dataclass(frozen=True)
    class Settings:
        def __post_init__(self) -> None:
            raise AttributeError("careless")


def stop(rover_file: Path, text: str) -> str:
    rover_file.write_text(text, encoding="utf-8")
    return stop_motors(str(rover_file))
