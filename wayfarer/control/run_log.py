"""The interface of a log of a run; a base for logs that keep only a part of it; and one that passes it to several."""

from __future__ import annotations

from typing import Protocol

from wayfarer.control.tick_record import TickRecord
from wayfarer.hal import MotorHealth, PositionFix, WheelCommand


class RunLog(Protocol):
    """Receives everything that a run reports. No method may raise or wait: logging must not disturb control."""

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
    """Ignores everything; a log that needs only a part of a run overrides those methods."""

    def tick(self, record: TickRecord) -> None:
        """Ignore a control tick."""

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Ignore an event."""

    def position(self, fix: PositionFix | None) -> None:
        """Ignore a position."""

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Ignore a report of the motor board."""

    def close(self, reason: str, text: str) -> None:
        """Ignore the outcome."""


class Tee:
    """Passes a run to several logs."""

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
