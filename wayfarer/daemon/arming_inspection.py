"""The checks before arming, on parts that the daemon has open: they read the sensor tasks' latest values."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

from wayfarer.commissioning.checks.api import HostEnvironment, Inspection
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.supervisor import Supervisor
from wayfarer.errors import NotResponding
from wayfarer.fieldlog.vocabulary import in_words
from wayfarer.hal import MotorHealth, Rover

FRESH_S = 1.0


class RunningInspection(Inspection):
    """An ``Inspection`` of a running rover; it opens nothing and reads nothing by itself."""

    def __init__(self, config: RoverConfig, rover: Rover, host: HostEnvironment, supervisor: Supervisor) -> None:
        used = {row.name for row in supervisor.tasks}
        read = rover if "contact" in used else replace(rover, contact=None)  # an unused bumper is not read
        super().__init__(config, read, host)
        self._supervisor = supervisor

    async def open(self, name: str) -> None:
        """Do nothing for a part that the run has opened; the motors are opened again, which verifies their deadman."""
        if name == "motors":
            await self.rover.motors.open()

    async def motor_health(self) -> MotorHealth:
        """Ask the motor board."""
        return await self.rover.motors.health()

    async def _read(self, sense: str) -> Any:
        """Return the latest reading of a sensor's task."""
        last = self._supervisor.controller.last
        if last is None:
            raise NotResponding("the rover's parts are still being opened: try again in some seconds")
        reading = self._supervisor.buffers.motion.latest if sense == "motion" else getattr(last, sense)
        if reading is None or asyncio.get_running_loop().time() - reading.t_s > FRESH_S:
            raise NotResponding(f"the {in_words(sense)} has said nothing for {FRESH_S:g} s; see the log for why")
        return reading
