"""Dry run: everything on the real rover except motion."""

from __future__ import annotations

from collections.abc import Mapping

from wayfarer.hal import STOP, DriveMotors, MotorHealth, WheelCommand, error_counts_of


class DryMotors:
    """Motors that are opened, asked and stopped, but never commanded to turn; implements ``hal.DriveMotors``."""

    def __init__(self, motors: DriveMotors) -> None:
        self._motors = motors
        self.name = f"{motors.name} (dry run)"
        self.deadman_s = motors.deadman_s

    @property
    def error_counts(self) -> Mapping[str, int]:
        """The error counts of the motors."""
        return error_counts_of(self._motors)

    async def open(self) -> None:
        """Open the motors: their deadman is verified as in any run."""
        await self._motors.open()

    async def close(self) -> None:
        """Close the motors."""
        await self._motors.close()

    async def drive(self, command: WheelCommand) -> WheelCommand:  # noqa: ARG002
        """Command zero, independent of the wanted duties."""
        return await self._motors.drive(STOP)

    async def stop(self) -> None:
        """Stop the motors."""
        await self._motors.stop()

    def halt(self) -> None:
        """Stop the motors, from any thread."""
        self._motors.halt()

    async def read_back(self) -> WheelCommand | None:
        """Ask the motors."""
        return await self._motors.read_back()

    async def health(self) -> MotorHealth:
        """Ask the motors."""
        return await self._motors.health()
