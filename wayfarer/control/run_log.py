"""The base of all logs of a run, and small ones.

Events are logged as with any structlog logger, ``log.logger.warning("sensor_failed", t_s=..., text=..., sensor=...)``:
the name of the event, the loop's time, a sentence for people, and the details. There is a base for logs that keep only
a part of a run, one that passes a run to several logs, and one that notes the retry counters of drivers, so that a
loose wire shows early.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import structlog
from mypy_extensions import mypyc_attr
from structlog.typing import EventDict, FilteringBoundLogger, WrappedLogger

from wayfarer.control.tick import TickRecord
from wayfarer.hal import Driver, HasErrorCounts, MotorHealth, PositionFix, WheelCommand

NOTE_HZ: Final = 1.0  # of the retry counters; chosen by us
SEVERITY: Final = {"well": "info", "note": "info", "degrade": "warning", "hold": "warning", "fault": "error"}


@mypyc_attr(allow_interpreted_subclasses=True)
class RunLog:
    """Receives everything that a run reports, and ignores it: a log overrides what it keeps.

    No method may raise or wait: logging must not disturb control.
    """

    _logger: FilteringBoundLogger | None = None

    @property
    def logger(self) -> FilteringBoundLogger:
        """The logger for events; ``event`` gets all that is written to it, with context and severity."""
        if self._logger is None:
            self._logger = _logger_for(self)
        return self._logger

    @logger.setter
    def logger(self, logger: FilteringBoundLogger) -> None:
        self._logger = logger

    def bind(self, **context: object) -> None:
        """Add to the context of each further event."""
        self._logger = self.logger.bind(**context)

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


def _logger_for(log: RunLog) -> FilteringBoundLogger:
    def give(_logger: WrappedLogger, method: str, event: EventDict) -> EventDict:
        details = dict(event)
        log.event(details.pop("event"), details.pop("t_s"), severity=method, **details)
        raise structlog.DropEvent

    every_severity = structlog.make_filtering_bound_logger(0)
    logger: FilteringBoundLogger = structlog.wrap_logger(None, [give], every_severity).bind()
    return logger


@mypyc_attr(allow_interpreted_subclasses=True)
class Tee(RunLog):
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
                told = ", ".join(f"{what.replace('_', ' ')}: {count}" for what, count in counts.items())
                self._log.logger.info(  # not a warning: the driver recovered by itself
                    "part_troubles", t_s=t_s, text=f"The {part.name} still works after errors ({told})",
                    part=part.name, counts=counts,
                )  # fmt: skip
