"""Motors that write down what they are told, where the service may write: how the test knows that a stop was sent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from tests.kit.motors import Motors
from wayfarer.drivers.buses import Buses
from wayfarer.hal import STOP, WheelCommand

TOLD = Path("/var/lib/wayfarer/wheels.txt")


@dataclass(frozen=True, slots=True)
class NoSettings:
    """Nothing to set."""


class Wheels(Motors):
    """Implements ``hal.DriveMotors``."""

    part: ClassVar[str] = "motors"
    Settings = NoSettings
    name = f"wheels in {TOLD}"

    def __init__(self, settings: NoSettings, buses: Buses) -> None:
        super().__init__()

    async def drive(self, command: WheelCommand) -> WheelCommand:
        self._write(f"drive {command.left} {command.right}")
        return command

    async def stop(self) -> None:
        self._write("stop")

    def halt(self) -> None:
        self._write("halt")

    async def read_back(self) -> WheelCommand | None:
        return STOP

    def _write(self, told: str) -> None:
        with TOLD.open("a", encoding="utf-8") as file:
            file.write(told + "\n")
