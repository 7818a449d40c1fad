"""The shell around the controller: the only part of a tick that waits. Inputs in, wheels out, log last."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from wayfarer.control.controller import Controller
from wayfarer.control.rate import Rate
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import Inbox
from wayfarer.errors import BadReading, DriverError, PowerLost
from wayfarer.hal import STOP, WheelCommand
from wayfarer.safety.mission import RunEnd


class WheelMotors(Protocol):
    """The part of ``hal.DriveMotors`` that a tick uses."""

    async def drive(self, command: WheelCommand) -> WheelCommand:
        """Apply the command and return what was really applied."""

    def halt(self) -> None:
        """Send a stop without waiting for it."""


def loop_time() -> float:
    """Return the time of now, on the clock of the running loop."""
    return asyncio.get_running_loop().time()


class ControlLoop:
    """Does the control ticks until something ends the run; ``ticked`` is set by the first one.

    Args:
        motors: take the commands.
        inbox: has what came from outside.
        controller: decides.
        log: takes each tick, and what followed from it.
        late_s: the age of a tick beyond which its command is a stop.
        clock: the time of now, on the clock of the ticks.
    """

    def __init__(
        self,
        motors: WheelMotors,
        inbox: Inbox,
        controller: Controller,
        log: RunLog,
        late_s: float,
        clock: Callable[[], float] = loop_time,
    ) -> None:
        self._motors = motors
        self._inbox = inbox
        self._controller = controller
        self._log = log
        self._clock = clock
        self._late_s = late_s
        self.ticked = asyncio.Event()

    async def run(self, rate_hz: float) -> RunEnd:
        """Tick at this rate; return what has ended the run."""
        controller, rate = self._controller, Rate(rate_hz)
        end = controller.end  # in a variable: compiled, an attribute that was None is taken to be None after a tick too
        while end is None:
            await self.tick(self._clock())
            self.ticked.set()
            end = controller.end
            if end is None:
                await rate.wait()
                end = controller.end
        return end

    async def tick(self, t_s: float) -> None:
        """Do one control tick at time ``t_s``. While the motors are waited for, somebody may ask for something.

        Raises:
            MemoryError: see ``Controller.lose_tick``.
        """
        controller = self._controller
        try:
            tick, mode = controller.step(self._inbox.take(t_s)), controller.mode
            if tick.halts:
                self._motors.halt()
            tick.applied = self._inbox.next.applied = await self._drive(t_s, tick.wheels)
            if tick.wheels != STOP and (controller.mode is not mode or not controller.may_turn):
                self._motors.halt()  # somebody stopped the rover, or took it over; the command may have come after that
            controller.last = tick
            self._log.tick(tick)
            for severity, name, details in tick.concluded:
                getattr(self._log.logger, severity)(name, t_s=t_s, **details)
        except MemoryError as error:
            self._motors.halt()
            self._inbox.next.applied = STOP
            controller.lose_tick(t_s, error)

    async def _drive(self, t_s: float, command: WheelCommand) -> WheelCommand:
        """Apply the command of the tick that began at ``t_s``, and return what was applied.

        A process can be suspended at any point, also between a decision and its command. When it continues, seconds
        later, it would first send that old command, before the next tick notices that time is missing. So a stop is
        sent in its place.
        """
        if self._clock() - t_s > self._late_s:
            command = STOP
        try:
            applied = await self._motors.drive(command)
            left, right = applied
            if abs(left) <= 1.0 and abs(right) <= 1.0:  # NaN is no duty
                return applied
            raise BadReading(  # what the wheels do is not known (fault catalogue, fault 8)
                f"motors: duties of {left:g} and {right:g} applied, allowed are -1 to 1: their driver has a bug"
            )
        except DriverError as error:
            self._motors.halt()  # a command that waits on the bus may still reach the board: a stop directly after it
            self._controller.motors_lost(t_s, str(error), "power" if isinstance(error, PowerLost) else None)
            return STOP
