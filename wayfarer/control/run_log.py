"""The interface of a log of a run, and small logs for it.

There is a base for logs that keep only a part of a run, one that passes a run to several logs, and one that notes the
retry counters of drivers, so that a loose wire shows early.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from wayfarer.control.tick import TickRecord
from wayfarer.hal import Driver, HasErrorCounts, MotorHealth, PositionFix, WheelCommand

NOTE_HZ = 1.0  # of the retry counters; chosen by us


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


class DriverCounters:
    """Writes an event for each part whose counts have changed since the last ``note``.

    ``counting`` are the parts that count errors, with the counts noted last.
    """

    def __init__(self, parts: Iterable[Driver], log: RunLog) -> None:
        self.counting: dict[HasErrorCounts, dict[str, int]] = {
            part: {} for part in parts if isinstance(part, HasErrorCounts)
        }
        self._log = log

    def note(self, t_s: float) -> None:
        """Write an event for each part whose counts have changed."""
        for part, noted in self.counting.items():
            counts = {what: count for what, count in part.error_counts.items() if count}
            if counts != noted:
                self.counting[part] = counts
                self._log.event("part_troubles", t_s, part=part.name, counts=counts)
