"""Debounce: a condition counts only after it has lasted for a given time."""

from __future__ import annotations

from wayfarer.safety.tick_interval import ROUNDING_S


class Debounce:
    """Holds back a condition until it has lasted."""

    __slots__ = ("_for_s", "_since_s")

    def __init__(self, for_s: float) -> None:
        self._for_s = for_s - ROUNDING_S
        self._since_s: float | None = None

    def update(self, t_s: float, present: bool) -> bool:
        """Return whether it has been present, without a gap, for long enough."""
        if not present:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = t_s
        return t_s - self._since_s >= self._for_s
