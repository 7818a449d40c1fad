"""Elapsed time: the number by which every tool names a moment of a run. Pure."""

from __future__ import annotations

from typing import Any

DECIMALS = 6  # microseconds: a clock that has run for 31 years (``schema.SINCE_BOOT``) still counts them


class Elapsed:
    """Counts the seconds since the first record of a log that could be read.

    ``t_s`` counts from an unknown moment, mostly the start of the computer. Give all records to one object, the first
    one first. A record that stands behind the first one but has an earlier ``t_s`` gets a negative number.
    """

    def __init__(self) -> None:
        self._began_t_s: float | None = None

    def at(self, record: dict[str, Any]) -> float:
        """Return ``elapsed_s`` of a record."""
        t_s: float = record["t_s"]
        if self._began_t_s is None:
            self._began_t_s = t_s
        return round(t_s - self._began_t_s, DECIMALS)
