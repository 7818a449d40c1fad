"""Motors that write down what they are told, where the service may write: how the test knows that a stop was sent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from wayfarer.drivers.buses import Buses
from wayfarer.hal import STOP, MotorHealth, WheelCommand

TOLD = Path("/var/lib/wayfarer/wheels.txt")


@dataclass(frozen=True, slots=True)
class NoSettings:
    """Nothing to set."""


class Wheels:
    """Implements ``hal.DriveMotors``."""

    part: ClassVar[str] = "motors"
    Settings = NoSettings
    deadman_s: float | None = None

    def __init__(self, settings: NoSettings, buses: Buses) -> None:
        self.name = f"wheels in {TOLD}"

    async def open(self) -> None:
        pass

    async def close(self) -> None:
        pass

    async def drive(self, command: WheelCommand) -> WheelCommand:
        self._write(f"drive {command.left} {command.right}")
        return command

    async def stop(self) -> None:
        self._write("stop")

    def halt(self) -> None:
        self._write("halt")

    async def read_back(self) -> WheelCommand | None:
        return STOP

    async def health(self) -> MotorHealth:
        return MotorHealth(None, ())

    def _write(self, told: str) -> None:
        with TOLD.open("a", encoding="utf-8") as file:
            file.write(told + "\n")
