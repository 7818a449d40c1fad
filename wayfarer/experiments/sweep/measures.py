"""The four measures at each point of a sweep, with 95 % intervals."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import Z_95, Estimate, wilson_interval


def share(rows: Sequence[TrialRow], outcomes: Sequence[str]) -> Estimate:
    """Return how many of the trials, at least one, ended so, in percent, with Wilson's interval."""
    count = sum(row.outcome in outcomes for row in rows)
    low, high = wilson_interval(count, len(rows))
    return Estimate(100.0 * count / len(rows), 100.0 * low, 100.0 * high)


def mean(values: Iterable[float | None]) -> Estimate | None:
    """Return the mean of the known values with 1.96 standard errors on both sides; None of fewer than two."""
    known = [value for value in values if value is not None]
    if len(known) < 2:
        return None
    centre = statistics.fmean(known)
    half = Z_95 * statistics.stdev(known) / math.sqrt(len(known))
    return Estimate(centre, centre - half, centre + half)


@dataclass(frozen=True, slots=True)
class Measure:
    """A figure of a point: its name, what it is, how many decimals it deserves, and how to estimate it."""

    name: str
    title: str
    decimals: int
    of: Callable[[Sequence[TrialRow]], Estimate | None]


MEASURES = (
    Measure("success", "success, %", 1, lambda rows: share(rows, SUCCESSES)),
    Measure("spl", "SPL", 3, lambda rows: mean(row.counted_spl for row in rows)),
    Measure("path", "path, m", 1, lambda rows: mean(row.escape_path_m for row in rows)),
    Measure("left_bounds", "left the map, %", 1, lambda rows: share(rows, ("left_bounds",))),
)


def spl_difference(rows: Sequence[TrialRow], others: Sequence[TrialRow]) -> Estimate | None:
    """Return by how much the SPL exceeds that of the same trials at another point; None where it is unknown."""
    pairs = ((row.counted_spl, other.counted_spl) for row, other in zip(rows, others, strict=True))
    return mean([here - there for here, there in pairs if here is not None and there is not None])
