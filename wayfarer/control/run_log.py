"""The interface of a log of a run, and logs that take a part of a run or pass it on."""

from __future__ import annotations

from typing import Protocol

from wayfarer.control.tick_record import TickRecord
from wayfarer.hal import MotorHealth, PositionFix, WheelCommand


class RunLog(Protocol):
    """Where a run writes. No method may raise or wait: logging never reaches into control."""

    def tick(self, record: TickRecord) -> None:
        """Take the record of one control tick."""

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take something that happened at ``t_s`` on the loop's clock."""

    def position(self, fix: PositionFix | None) -> None:
        """Take a position."""

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Take what the motor board reports, and the duties that it applies (None: not reported)."""

    def close(self, reason: str, text: str) -> None:
        """Write the outcome and end the log."""


class PartialLog:
    """Takes a run and keeps nothing of it; a log that wants only a part of a run overrides that part."""

    def tick(self, record: TickRecord) -> None:
        """Let a control tick pass."""

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Let an event pass."""

    def position(self, fix: PositionFix | None) -> None:
        """Let a position pass."""

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Let what the motor board says pass."""

    def close(self, reason: str, text: str) -> None:
        """Let the outcome pass."""


class Tee:
    """Several logs that take the same run."""

    def __init__(self, *logs: RunLog) -> None:
        self._logs = logs

    def tick(self, record: TickRecord) -> None:
        """Take the record of one control tick."""
        for log in self._logs:
            log.tick(record)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take something that happened."""
        for log in self._logs:
            log.event(name, t_s, **details)

    def position(self, fix: PositionFix | None) -> None:
        """Take a position."""
        for log in self._logs:
            log.position(fix)

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Take what the motor board reports."""
        for log in self._logs:
            log.board(t_s, health, duties)

    def close(self, reason: str, text: str) -> None:
        """Write the outcome and end the logs."""
        for log in self._logs:
            log.close(reason, text)
