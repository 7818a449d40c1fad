"""Asks the motor board for its status, and opens a board again that failed while a mission waits for it.

A rover whose motor board was silent for a moment, or lost its power, is not lost: the board may answer again. So the
board is opened again after a pause, as at each arming, which proves that it answers and that its deadman is on. Only
then the mission goes on, and the gate lets the wheels turn after the warning of ``gate.ResumeWarning``. Opening
commands no wheel to turn. If somebody disarms the rover meanwhile, what was opened has no effect (``Controller``).
"""

from __future__ import annotations

import asyncio
from math import inf
from typing import Final

from wayfarer.control.controller import Controller
from wayfarer.control.rate import Rate
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import BoardReport, Inbox
from wayfarer.errors import DriverError
from wayfarer.hal import DriveMotors, MotorHealth

# Two ticks: one of them has judged the report. So two reports and a stop fit into 0.5 s (fault catalogue, fault 30).
DOUBT_S: Final = 0.1
# Ardumower Sunray resets a motor driver that has failed after 1 s. That each further pause is twice as long, the
# longest one, and when the pauses begin again with the shortest: chosen by us.
REOPEN_AFTER_S: Final = 1.0
REOPEN_AFTER_MAX_S: Final = 60.0
STEADY_S: Final = 60.0  # a board that has worked for so long since it was opened


class BoardWatch:
    """The task of the motor board.

    Args:
        motors: the board.
        inbox: takes the reports.
        controller: says whether a mission waits for the board.
        log: takes each failed try.
        health_hz: how often the board is asked.
    """

    def __init__(
        self, motors: DriveMotors, inbox: Inbox, controller: Controller, log: RunLog, health_hz: float
    ) -> None:
        self._motors = motors
        self._inbox = inbox
        self._controller = controller
        self._log = log
        self._health_hz = health_hz
        self._pause_s = REOPEN_AFTER_S
        self._due_s: float | None = None
        self._opened_s = -inf

    async def run(self) -> None:
        """Ask for ever, sooner again if the answer is doubtful; the controller acts on it."""
        rate = Rate(self._health_hz)
        while True:
            if self._is_due():
                await self._reopen()
            else:
                await self._ask()
            await asyncio.sleep(DOUBT_S)
            if self._controller.board.doubtful:
                await self._ask()
            await rate.wait()

    async def _ask(self) -> MotorHealth | None:
        """Ask the board and pass the answer on; None if there is none."""
        motors, time = self._motors, asyncio.get_running_loop().time
        try:
            health, duties = await motors.health(), await motors.read_back()
        except DriverError as error:
            self._inbox.put_board(BoardReport(time(), None, error=str(error)))
            return None
        self._inbox.put_board(BoardReport(time(), health, duties))
        return health

    def _is_due(self) -> bool:
        """Return whether a mission waits for the board, and the pause is over."""
        now_s = asyncio.get_running_loop().time()
        if not self._controller.waits_for_motors:
            self._due_s = None
            if now_s - self._opened_s > STEADY_S:
                self._pause_s = REOPEN_AFTER_S
            return False
        if self._due_s is None:
            self._due_s = now_s + self._pause_s
            self._pause_s = min(2.0 * self._pause_s, REOPEN_AFTER_MAX_S)
        return now_s >= self._due_s

    async def _reopen(self) -> None:
        """Open the board, and let the mission go on if nothing has failed meanwhile.

        A command of a tick may fail while the board is being opened: then what has been proved may be out of date.
        """
        controller, time, self._due_s = self._controller, asyncio.get_running_loop().time, None
        failures = controller.failures
        try:
            await self._motors.open()
        except DriverError as error:
            text = f"The motor board could not be opened again: {error} (tried again in {self._pause_s:.0f} s)"
            self._log.logger.warning(
                "motors_not_opened", t_s=time(), text=text, error=str(error), retry_in_s=self._pause_s
            )
            return
        health = await self._ask()
        if health is not None and not health.faults and controller.failures == failures:
            self._opened_s = time()
            controller.motors_opened(self._opened_s)
