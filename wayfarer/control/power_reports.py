"""Collects the reports of the motor board and of the computer's supply between two ticks. Pure.

A report counts, and is logged, at the beginning of the next tick, so that a replay gets it at the same tick.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial

from wayfarer.control.run_log import RunLog
from wayfarer.hal import STOP, MotorHealth, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.safety.power import MotorBoardMonitor, SupplyMonitor, meaning
from wayfarer.safety.settings import BoardSettings


class PowerReports:
    """Takes reports as they come, and judges them when ``judge`` is called, at the beginning of each tick."""

    def __init__(self, settings: BoardSettings, log: RunLog) -> None:
        self.board = MotorBoardMonitor(settings)
        self.supply = SupplyMonitor()
        self._log = log
        self._pending: list[Callable[[], None]] = []
        # The commands of the last three ticks: the board may have been asked during any of them.
        self._applied = deque([STOP] * 3, maxlen=3)

    # -- reports -------------------------------------------------------------------------------------------------

    def board_said(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Take the report of the motor board at ``t_s``; see ``MotorBoardMonitor.update``."""
        self._pending.append(partial(self._judge_board, t_s, health, duties))

    def board_silent(self, t_s: float, error: str) -> None:
        """Note that the motor board did not answer."""
        self._pending.append(partial(self._judge_silence, t_s, error))

    def power(self, t_s: float, flags: int | None) -> None:
        """Take the power flags of the computer's firmware, None if there are none; see ``SupplyMonitor``."""
        self._pending.append(partial(self._judge_power, t_s, flags))

    # -- at each tick --------------------------------------------------------------------------------------------

    def judge(self, applied: WheelCommand) -> bool:
        """Judge the reports since the last tick, which applied ``applied``; return whether there may be conditions."""
        self._applied.append(applied)
        if self._pending:
            reports, self._pending = self._pending, []
            for report in reports:
                report()
        return bool(self.board.conditions) or self.supply.noticed

    def conditions(self, t_s: float) -> tuple[Condition, ...]:
        """Return the conditions at ``t_s``."""
        return self.board.conditions + self.supply.conditions(t_s)

    def _judge_board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        self.board.update(t_s, health, duties, self._applied)
        self._log.board(t_s, health, duties)

    def _judge_silence(self, t_s: float, error: str) -> None:
        if Condition.BOARD_SILENT not in self.board.conditions:
            self._log.event("board_silent", t_s, error=error)
        self.board.silent()

    def _judge_power(self, t_s: float, flags: int | None) -> None:
        before, now = self.supply.flags or 0, flags or 0
        self.supply.update(t_s, flags)
        if now != before:
            self._log.event("power", t_s, flags=f"{now:#x}", text=meaning(now))
