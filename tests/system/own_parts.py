"""A rover of one's own, as a person has it in /etc/wayfarer: motors that write down what they are told."""

import asyncio
from dataclasses import dataclass
from pathlib import Path

from wayfarer.drivers.buses import Buses
from wayfarer.hal import STOP, CompassReading, ContactReading, MotorHealth, WheelCommand

TOLD = Path("/var/lib/wayfarer/own_wheels.txt")


class Part:
    @dataclass(frozen=True)
    class Settings:
        pass

    def __init__(self, settings: Settings, buses: Buses) -> None:
        pass

    async def open(self) -> None:
        pass

    async def close(self) -> None:
        pass

    def _now(self) -> float:
        return asyncio.get_running_loop().time()


class Wheels(Part):
    part, name, deadman_s = "motors", "wheels of mine", 0.5
    _applied = STOP

    async def drive(self, command: WheelCommand) -> WheelCommand:
        self._write(f"drive {command.left:.2f} {command.right:.2f}")
        self._applied = command
        return command

    async def stop(self) -> None:
        self._write("stop")
        self._applied = STOP

    def halt(self) -> None:
        self._write("halt")

    async def read_back(self) -> WheelCommand:
        return self._applied

    async def health(self) -> MotorHealth:
        return MotorHealth(None, ())

    def _write(self, told: str) -> None:
        with TOLD.open("a", encoding="utf-8") as file:
            file.write(told + "\n")


class Needle(Part):
    part, name = "compass", "needle of mine"

    async def read(self) -> CompassReading:
        return CompassReading(self._now(), 0.0, 0.0, 0.0, 3)


class Bumper(Part):
    part, name = "contact", "bumper of mine"

    async def read(self) -> ContactReading:
        return ContactReading(self._now(), (), None)
