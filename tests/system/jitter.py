"""How evenly the control loop ticks, from its log."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import median, quantiles
from typing import NamedTuple

PERIOD_S = 0.05  # of the shipped rovers


class Jitter(NamedTuple):
    """How far the time between two ticks is from the period: median, 95th percentile and worst, in seconds."""

    median_s: float
    p95_s: float
    worst_s: float

    def __str__(self) -> str:
        return f"{1e3 * self.median_s:.1f} / {1e3 * self.p95_s:.1f} / {1e3 * self.worst_s:.1f} ms"


def jitter(times_s: Sequence[float], from_s: float, to_s: float) -> Jitter:
    """Return the jitter of the ticks in a span of time.

    Raises:
        ValueError: there are hardly any.
    """
    there = [t_s for t_s in times_s if from_s <= t_s <= to_s]
    if len(there) < 0.5 * (to_s - from_s) / PERIOD_S:
        raise ValueError(f"only {len(there)} ticks in {to_s - from_s:.1f} s")
    off = [abs(later - earlier - PERIOD_S) for earlier, later in pairwise(there)]
    return Jitter(median(off), quantiles(off, n=20)[-1], max(off))
