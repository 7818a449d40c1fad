"""Motors that turn no wheel: they remember what they were told."""

from __future__ import annotations

from wayfarer.errors import DriverError
from wayfarer.hal import MotorHealth, WheelCommand


class Motors:
    """Remembers each command, and how often it was halted; ``error`` is raised instead while it is set."""

    name = "bench motors"
    deadman_s: float | None = None

    def __init__(self) -> None:
        self.commands: list[WheelCommand] = []
        self.halts = 0
        self.error: DriverError | None = None

    async def drive(self, command: WheelCommand) -> WheelCommand:
        if self.error is not None:
            raise self.error
        self.commands.append(command)
        return command

    async def open(self) -> None: ...

    async def close(self) -> None: ...

    async def stop(self) -> None: ...

    def halt(self) -> None:
        self.halts += 1

    async def read_back(self) -> WheelCommand | None:
        return None

    async def health(self) -> MotorHealth:
        return MotorHealth(None, ())
