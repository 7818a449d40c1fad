"""Writes what an algorithm remembers of the wood into the log."""

from __future__ import annotations

from math import hypot, inf
from typing import Final

from wayfarer.control.run_log import RunLog
from wayfarer.escape.api import ContactMap, EscapeHandler, Remembers

NOTE_S: Final = 1.0  # from one note to the next at least: a person reads no faster
MOST: Final = 32  # trunks, the nearest to the rover, and waypoints, the first: a record of 2 kB
DIGITS: Final = 2  # centimetres, far finer than dead reckoning


class ContactMapNotes:
    """Writes an event when the map of an algorithm with a memory has changed, at most once in ``NOTE_S``.

    A map that cannot be made or read ends the notes, not the run.
    """

    def __init__(self, handler: EscapeHandler, log: RunLog) -> None:
        self._handler = handler if isinstance(handler, Remembers) else None
        self._log = log
        self._noted: int | None = None
        self._due_s = -inf

    def note(self, t_s: float) -> None:
        """Write the map if it has changed since it was last written, after the tick at ``t_s``."""
        handler = self._handler
        if handler is None or t_s < self._due_s:
            return
        try:
            changes = handler.changes
            if self._noted is None:
                self._noted = changes  # no news: a rover that was not armed yet plans nothing
            if changes == self._noted:
                return
            self._noted, self._due_s = changes, t_s + NOTE_S
            self._write(t_s, handler.contact_map())
        except Exception as error:  # a third party's; no picture is worth a run
            self._handler = None
            self._log.event("viewer_failed", t_s, error=f"contact_map: {error!r}")

    def _write(self, t_s: float, seen: ContactMap) -> None:
        def distance_m(trunk: tuple[float, float, float, float, float]) -> float:
            ahead0_m, right0_m, ahead1_m, right1_m, _ = trunk
            return hypot((ahead0_m + ahead1_m) / 2.0 - seen.ahead_m, (right0_m + right1_m) / 2.0 - seen.right_m)

        self._log.event(
            "contact_map",
            t_s,
            ahead_m=round(seen.ahead_m, DIGITS),
            right_m=round(seen.right_m, DIGITS),
            trunks=[[round(value, DIGITS) for value in trunk] for trunk in sorted(seen.trunks, key=distance_m)[:MOST]],
            way=[[round(value, DIGITS) for value in waypoint] for waypoint in seen.way[:MOST]],
            mode=seen.mode,
        )
