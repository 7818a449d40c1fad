"""The shell around the controller: the only part of a tick that waits. Inputs in, wheels out, log last."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

from wayfarer.control.controller import Controller
from wayfarer.control.modes import Mode
from wayfarer.control.rate import AtOnce, Clock, Rate, without_waiting
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import Inbox, TickRecord
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


class ControlLoop(AtOnce):
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
        self._drive_without_waiting = without_waiting(motors, "drive")
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
        if end is None:
            await self.tick(self._clock())
            self.ticked.set()
            end = controller.end
        while end is None:
            await rate.wait(self)
            end = controller.end
            if end is None:
                await self.tick(self._clock())
                end = controller.end
        return end

    async def tick(self, t_s: float) -> None:
        """Do one control tick at time ``t_s``. While the motors are waited for, somebody may ask for something.

        Raises:
            MemoryError: see ``Controller.lose_tick``.
        """
        try:
            tick = self._decide(t_s)
            mode = self._controller.mode
            try:
                applied = checked(await self._motors.drive(self._command(tick, self._clock())))
            except DriverError as error:
                applied = self._lose_motors(t_s, error)
            self._conclude(tick, mode, applied)
        except MemoryError as error:
            self._lose(t_s, error)

    def at_once(self, clock: Clock) -> bool:
        """Do one control tick, if these motors never wait; see ``tick``. Return False also if the run has ended."""
        drive, controller = self._drive_without_waiting, self._controller
        end = controller.end  # in a variable, see ``run``
        if drive is None or end is not None:
            return False
        t_s = clock.time()
        try:
            tick = self._decide(t_s)
            mode = controller.mode
            try:
                now_s = clock.time()
                applied = checked(drive(now_s, self._command(tick, now_s)))
            except DriverError as error:
                applied = self._lose_motors(t_s, error)
            self._conclude(tick, mode, applied)
        except MemoryError as error:
            self._lose(t_s, error)
        return controller.end is None

    def _decide(self, t_s: float) -> TickRecord:
        tick = self._controller.step(self._inbox.take(t_s))
        if tick.halts:
            self._motors.halt()
        return tick

    def _command(self, tick: TickRecord, now_s: float) -> WheelCommand:
        """Return what the motors get.

        A process can be suspended at any point, also between a decision and its command. When it continues, seconds
        later, it would first send that old command, before the next tick notices that time is missing. So a stop is
        sent in its place.
        """
        return STOP if now_s - tick.t_s > self._late_s else tick.wheels

    def _lose_motors(self, t_s: float, error: DriverError) -> WheelCommand:
        """Return what is applied if the motors did not take the command of the tick at ``t_s``."""
        self._motors.halt()  # a command that waits on the bus may still reach the board: a stop directly after it
        self._controller.motors_lost(t_s, str(error), "power" if isinstance(error, PowerLost) else None)
        return STOP

    def _conclude(self, tick: TickRecord, mode: Mode, applied: WheelCommand) -> None:
        """Take the tick, decided in ``mode``, as the latest, and log it."""
        controller = self._controller
        tick.applied = self._inbox.next.applied = applied
        if (controller.mode is not mode or not controller.may_turn) and tick.wheels != STOP:
            self._motors.halt()  # somebody stopped the rover, or took it over; the command may have come after that
        controller.last = tick
        self._log.tick(tick)
        for severity, name, details in tick.concluded:
            getattr(self._log.logger, severity)(name, t_s=tick.t_s, **details)

    def _lose(self, t_s: float, error: MemoryError) -> None:
        """Stop the wheels: no memory was left for the tick at ``t_s``."""
        self._motors.halt()
        self._inbox.next.applied = STOP
        self._controller.lose_tick(t_s, error)


def checked(applied: WheelCommand) -> WheelCommand:
    """Return what a driver has applied.

    Raises:
        BadReading: it is not a duty; what the wheels do is not known (fault catalogue, fault 8).
    """
    left, right = applied.left, applied.right
    if abs(left) <= 1.0 and abs(right) <= 1.0:  # NaN is not a duty
        return applied
    raise BadReading(f"motors: duties of {left:g} and {right:g} applied, allowed are -1 to 1: their driver has a bug")
