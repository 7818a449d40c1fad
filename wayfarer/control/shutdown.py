"""Shutdown of a run: wheels first, then the parts, the log last. It cannot be cancelled or blocked."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Sequence
from contextlib import AsyncExitStack
from typing import Any

from wayfarer.control.run_log import RunLog
from wayfarer.errors import DriverError
from wayfarer.hal import STOP, DriveMotors, Driver
from wayfarer.safety.mission import RunEnd
from wayfarer.vocabulary import disarmed_text

STOP_DEADLINE_S = 0.3  # for the wheels, before the stop is sent without waiting for it
CLOSE_DEADLINE_S = 0.2  # for each part: the run must have ended 2 s after SIGTERM


class Shutdown:
    """Ends a run and closes its ``parts``, which include the motors."""

    def __init__(self, motors: DriveMotors, parts: Sequence[Driver], log: RunLog) -> None:
        self._motors = motors
        self._parts = parts
        self._log = log
        self.confirmed = False  # whether the latest stop was sent, and the board does not report otherwise

    async def stop_wheels(self) -> None:
        """Stop the wheels and ask the board whether they are stopped.

        If that hangs, or the board reports otherwise, the stop is sent again without waiting, and the log says so.
        Then the board's own deadman must stop the wheels.
        """
        self.confirmed = False
        try:
            async with asyncio.timeout(STOP_DEADLINE_S):
                await self._motors.stop()
                turning = await self._motors.read_back()
        except (TimeoutError, DriverError) as error:
            self._not_confirmed(str(error) or f"not finished within {STOP_DEADLINE_S:g} s")
        else:
            if turning is not None and turning != STOP:
                self._not_confirmed(f"the board still reports {turning.left:.2f} and {turning.right:.2f}")
            else:
                self.confirmed = True

    async def end(self, end: RunEnd) -> None:
        """Stop the wheels, close the parts and the log; each step is done even if another one fails or hangs."""
        t_s = asyncio.get_running_loop().time()
        async with AsyncExitStack() as last_things:  # it runs them from the last line to the first
            last_things.callback(self._log.close, end.reason, end.text)
            for part in self._parts:
                last_things.push_async_callback(self._close_part, part)
            last_things.callback(self._tell_of_stop, t_s, end.reason)  # nothing may fail before the wheels are stopped
            last_things.push_async_callback(self.stop_wheels)

    def _tell_of_stop(self, t_s: float, reason: str) -> None:
        text = f"The wheels are stopped: {disarmed_text(reason)}"
        self._log.logger.info("wheels_stopped", t_s=t_s, text=text, reason=reason)

    def _not_confirmed(self, why: str) -> None:
        self._motors.halt()
        name, t_s = self._motors.name, asyncio.get_running_loop().time()
        text = f"The {name} did not confirm the stop: {why}"
        self._log.logger.error("stop_not_confirmed", t_s=t_s, text=text, part=name, error=why)

    async def _close_part(self, part: Driver) -> None:
        try:
            async with asyncio.timeout(CLOSE_DEADLINE_S):
                await part.close()
        except TimeoutError:
            t_s, text = asyncio.get_running_loop().time(), f"The {part.name} did not close in time"
            self._log.logger.warning("close_hangs", t_s=t_s, text=text, part=part.name)


async def run_uncancellable(work: Coroutine[Any, Any, None]) -> None:
    """Do the work to its end even if this task is cancelled meanwhile; the cancellation is raised afterwards."""
    task = asyncio.ensure_future(work)
    cancelled: asyncio.CancelledError | None = None
    while not task.done():
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError as error:
            cancelled = error
    task.result()
    if cancelled is not None:
        raise cancelled
