"""Statistics of the control period: the time between consecutive ticks in the log. Pure."""

from __future__ import annotations

from array import array
from dataclasses import dataclass

LATE_S = 0.2  # as ``SafetySettings.tick_late_s``, where a header does not tell


@dataclass(frozen=True, slots=True)
class PeriodPercentiles:
    """Median, 99th percentile and longest of the periods, seconds."""

    p50_s: float
    p99_s: float
    max_s: float


class Periods:
    """Takes the times of ticks; ``late`` counts those that came more than ``late_s`` after the one before."""

    def __init__(self, late_s: float | None = None) -> None:
        self._late_s = late_s or LATE_S
        self._periods_s = array("d")
        self._t_s: float | None = None
        self.late = 0

    def interrupted(self) -> None:
        """Note that records are missing before the next tick: the number of ticks there is unknown."""
        self._t_s = None

    def take(self, t_s: float) -> None:
        """Take the next tick."""
        before_s, self._t_s = self._t_s, t_s
        if before_s is not None and t_s >= before_s:
            self._periods_s.append(t_s - before_s)
            self.late += t_s - before_s > self._late_s

    def spread(self) -> PeriodPercentiles | None:
        """Return how the periods spread; None where there is none."""
        ordered, last = sorted(self._periods_s), len(self._periods_s) - 1
        return PeriodPercentiles(*(ordered[round(part * last)] for part in (0.5, 0.99, 1.0))) if ordered else None
