"""The way to the wheels: commands that come too late, and motors that do not acknowledge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from wayfarer.control.run_log import RunLog
from wayfarer.errors import BadReading, DriverError, PowerLost
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.power import SupplyMonitor

# A stop that the board did not acknowledge may not have reached it. Its deadman stops the wheels after 0.3 s at most
# (as shipped); 0.5 s later motion has been seen to be over (fault catalogue, fault 30), by a camera 0.2 s after that.
UNHEARD_S: Final = 1.0


class WheelMotors(Protocol):
    """The part of ``hal.DriveMotors`` that the controller uses."""

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply the command and return what was really applied."""

    def halt(self) -> None:
        """Send a stop without waiting for it."""


class Wheels:
    """Sends the command of each tick.

    ``failed`` is whether the motor board must be opened again before a wheel may turn. ``failures`` counts the ticks
    whose command the motors did not acknowledge. What the wheels do is not known before ``unheard_until_s``.

    Args:
        motors: take the commands.
        late_s: the age of a tick beyond which its command is a stop.
        clock: the time of now, on the clock of the ticks.
        log: takes the first failure.
        supply: counts how often the motor board lost its power.
    """

    def __init__(
        self, motors: WheelMotors, late_s: float, clock: Callable[[], float], log: RunLog, supply: SupplyMonitor
    ) -> None:
        self._motors = motors
        self._supply = supply
        self._late_s = late_s
        self._clock = clock
        self._log = log
        self.failed = False
        self.failures = 0
        self.unheard_until_s = 0.0

    def halt(self) -> None:
        """Send a stop without waiting for it."""
        self._motors.halt()

    async def drive(self, t_s: float, command: WheelCommand) -> WheelCommand:
        """Apply the command of the tick that began at ``t_s``, and return what was applied.

        A process can be suspended at any point, also between a decision and its command. When it continues, seconds
        later, it would first send that old command, before the next tick notices that time is missing. So a stop is
        sent in its place.
        """
        if self._clock() - t_s > self._late_s:
            command = STOP
        try:
            return _checked(await self._motors.drive(command))
        except DriverError as error:
            self.lose(t_s, str(error), "power" if isinstance(error, PowerLost) else None)
            return STOP

    def lose(self, t_s: float, error: str, lost: str | None = None) -> None:
        """Hold the wheels until the board was opened again: without an acknowledgement their state is unknown.

        The board's deadman stops them. A command that waits on the bus may still reach the board, so a stop is sent
        directly after it. ``lost`` is ``power`` if the board lost its power, ``tick`` if the tick did not end.
        """
        self._motors.halt()
        self.failures += 1
        if not self.failed:
            self.unheard_until_s = t_s + UNHEARD_S
            self._log.event("motors_failed", t_s, error=error, lost=lost)
            if lost == "power":
                self._supply.dip(t_s)
        self.failed = True


def _checked(applied: WheelCommand) -> WheelCommand:
    """Return the duties that the motors report as applied.

    Raises:
        BadReading: impossible duties (fault catalogue, fault 8); what the wheels do is not known.
    """
    left, right = applied
    if abs(left) <= 1.0 and abs(right) <= 1.0:  # NaN is no duty
        return applied
    raise BadReading(f"motors: duties of {left:g} and {right:g} applied, allowed are -1 to 1: their driver has a bug")
