"""Inspection of a rover without a daemon: parts are opened when they are needed, and read directly."""

from __future__ import annotations

from types import TracebackType
from typing import Any, Self

from wayfarer.commissioning.checks.api import HostEnvironment, Inspection
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import DriverError
from wayfarer.hal import MotorHealth, Rover


class StandaloneInspection(Inspection):
    """An ``Inspection`` without a daemon; leaving its context stops the wheels and closes every part.

    A part that failed to open is not tried again: the same failure is raised at the next request.
    """

    def __init__(self, config: RoverConfig, rover: Rover, host: HostEnvironment) -> None:
        super().__init__(config, rover, host)
        self._tried: dict[str, DriverError | None] = {}

    async def __aenter__(self) -> Self:
        """Open nothing yet."""
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Stop the wheels, if the motors were opened, and close what was."""
        if "motors" in self._tried:
            await self.rover.motors.stop()
        for name in self._tried:
            await self.rover.parts[name].close()

    async def open(self, name: str) -> None:
        """Open a part, once."""
        if name not in self._tried:
            self._tried[name] = None
            try:
                await self.rover.parts[name].open()
            except DriverError as error:
                self._tried[name] = error
        if (failed := self._tried[name]) is not None:
            raise failed

    async def motor_health(self) -> MotorHealth:
        """Ask the motor board."""
        await self.open("motors")
        return await self.rover.motors.health()

    async def _read(self, sense: str) -> Any:
        await self.open(sense)
        return await getattr(self.rover, sense).read()
