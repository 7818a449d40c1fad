"""Refuses outdated wheel commands: the command of a tick that began too long ago becomes a stop.

A process can be suspended at any point, also between a decision and its command. When it continues, seconds later, it
would first send that old command, before the next tick notices that time is missing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any

from wayfarer.hal import STOP, DriveMotors, WheelCommand


class StaleCommandGuard:
    """Wraps the motors for the controller: a command of a tick that began too long ago is sent as a stop.

    Implements ``control.controller.WheelMotors``.

    Args:
        motors: take the commands.
        late_s: the age beyond which a command counts as old.
    """

    def __init__(self, motors: DriveMotors, late_s: float) -> None:
        self._motors = motors
        self._late_s = late_s
        self.tick_t_s = 0.0  # when the tick began whose command comes next

    def drive(self, command: WheelCommand) -> Coroutine[Any, Any, WheelCommand]:
        """Apply the command, or a stop in its place, and return what was applied."""
        age_s = asyncio.get_running_loop().time() - self.tick_t_s
        return self._motors.drive(command if age_s <= self._late_s else STOP)

    def halt(self) -> None:
        """Send a stop without waiting for it."""
        self._motors.halt()
