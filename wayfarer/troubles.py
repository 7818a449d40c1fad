"""What parts have got over by themselves, noted in the log: a wire that works loose is counted long before it fails."""

from __future__ import annotations

from collections.abc import Iterable

from wayfarer.hal import Counting, Driver
from wayfarer.records import RunLog

NOTE_HZ = 1.0


class TroubleNotes:
    """Writes an event for each part whose counts have changed since the last ``note``; ``counting`` are those parts."""

    def __init__(self, parts: Iterable[Driver], log: RunLog) -> None:
        self.counting = {part.name: part for part in parts if isinstance(part, Counting)}
        self._counts: dict[str, dict[str, int]] = dict.fromkeys(self.counting, {})
        self._log = log

    def note(self, t_s: float) -> None:
        """Look at all parts that count."""
        for name, part in self.counting.items():
            counts = {what: count for what, count in part.troubles.items() if count}
            if counts != self._counts[name]:
                self._counts[name] = counts
                self._log.event("part_troubles", t_s, part=name, counts=counts)
