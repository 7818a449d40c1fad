"""Logs driver retry counters, so that a loose wire shows early."""

from __future__ import annotations

from collections.abc import Iterable

from wayfarer.control.run_log import RunLog
from wayfarer.hal import Driver, HasErrorCounts

NOTE_HZ = 1.0


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
