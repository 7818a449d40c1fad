"""The interface of a log of a run, and small logs for it.

Events are logged as with any structlog logger, ``log.logger.warning("sensor_failed", t_s=..., text=..., sensor=...)``:
the name of the event, the loop's time, a sentence for people, and the details. There is a base for logs that keep only
a part of a run, one that passes a run to several logs, and one that notes the retry counters of drivers, so that a
loose wire shows early.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Final, Protocol

import structlog
from structlog.typing import EventDict, FilteringBoundLogger, WrappedLogger

from wayfarer.control.tick import TickRecord
from wayfarer.hal import Driver, HasErrorCounts, MotorHealth, PositionFix, WheelCommand

NOTE_HZ = 1.0  # of the retry counters; chosen by us
SEVERITY: Final = {"well": "info", "note": "info", "degrade": "warning", "hold": "warning", "fault": "error"}


class RunLog(Protocol):
    """Receives everything that a run reports. No method may raise or wait: logging must not disturb control."""

    @property
    def logger(self) -> FilteringBoundLogger:
        """The logger for events; ``event`` is given all that it is told, with its context and severity."""

    def bind(self, **context: object) -> None:
        """Add to the context of each further event."""

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take something that happened at ``t_s`` on the loop's clock: its ``text``, ``severity`` and other details."""

    def tick(self, record: TickRecord) -> None:
        """Take the record of one control tick."""

    def position(self, fix: PositionFix | None) -> None:
        """Take a position."""

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Take what the motor board reports, and the duties that it applies (None: not reported)."""

    def close(self, reason: str, text: str) -> None:
        """Write the outcome and end the log."""


class PartialLog:
    """Ignores everything; a log that needs only a part of a run overrides those methods."""

    @cached_property
    def logger(self) -> FilteringBoundLogger:
        """The logger for events."""

        def give(_logger: WrappedLogger, method: str, event: EventDict) -> EventDict:
            details = dict(event)
            self.event(details.pop("event"), details.pop("t_s"), severity=method, **details)
            raise structlog.DropEvent

        every_severity = structlog.make_filtering_bound_logger(0)
        logger: FilteringBoundLogger = structlog.wrap_logger(None, [give], every_severity).bind()
        return logger

    def bind(self, **context: object) -> None:
        """Add to the context of each further event."""
        self.logger = self.logger.bind(**context)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Ignore an event."""

    def tick(self, record: TickRecord) -> None:
        """Ignore a control tick."""

    def position(self, fix: PositionFix | None) -> None:
        """Ignore a position."""

    def board(self, t_s: float, health: MotorHealth, duties: WheelCommand | None) -> None:
        """Ignore a report of the motor board."""

    def close(self, reason: str, text: str) -> None:
        """Ignore the outcome."""


class Tee(PartialLog):
    """Passes a run to several logs."""

    def __init__(self, *logs: RunLog) -> None:
        self._logs = logs

    def bind(self, **context: object) -> None:
        """Add to the context of each further event, also of those that only one of the logs has."""
        super().bind(**context)
        for log in self._logs:
            log.bind(**context)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Take something that happened."""
        for log in self._logs:
            log.event(name, t_s, **details)

    def tick(self, record: TickRecord) -> None:
        """Take the record of one control tick."""
        for log in self._logs:
            log.tick(record)

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
                told = ", ".join(f"{count} {what.replace('_', ' ')}" for what, count in counts.items())
                self._log.logger.info(  # nothing is wrong: the driver has helped itself
                    "part_troubles", t_s=t_s, text=f"The {part.name} carried on after {told}",
                    part=part.name, counts=counts,
                )  # fmt: skip
