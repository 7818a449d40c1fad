"""What a campaign says of an algorithm: success with its interval, path lengths, SPL."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wayfarer.simhal.rows import SUCCESSES, Row

Z_95 = statistics.NormalDist().inv_cdf(0.975)


class Spread(NamedTuple):
    """Mean, sample standard deviation and median; None where there are too few values to tell."""

    mean: float | None
    sd: float | None
    median: float | None


@dataclass(frozen=True, slots=True)
class Summary:
    """One algorithm's line of the table.

    Path lengths are in metres, over the successes (escaped or left bounds), as in the paper. ``spl`` is the
    mean over all trials whose shortest path is known, where a failure counts 0. Time (simulated, in seconds)
    and anomalies are means a trial, faults left out.
    """

    algorithm: str
    trials: int
    escaped: int
    left_bounds: int
    entrapped: int
    tipped: int
    fault: int
    success_percent: float
    success_low_percent: float
    success_high_percent: float
    path_mean_m: float | None
    path_sd_m: float | None
    path_median_m: float | None
    spl: float | None
    time_mean_s: float | None
    anomalies_mean: float | None


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % score interval of a proportion, within 0..1 (E. B. Wilson, JASA 22, 1927).

    Raises:
        ValueError: no trials, or more successes than trials.
    """
    if not 0 <= successes <= trials or trials == 0:
        raise ValueError(f"{successes} successes in {trials} trials")
    share, spread = successes / trials, Z_95**2 / trials
    centre = share + spread / 2
    half = math.sqrt(spread * (share * (1 - share) + spread / 4))
    return max(0.0, (centre - half) / (1 + spread)), min(1.0, (centre + half) / (1 + spread))


def spread_of(values: Sequence[float]) -> Spread:
    """Return mean, sample standard deviation and median of ``values``, in their own unit."""
    return Spread(
        statistics.fmean(values) if values else None,
        statistics.stdev(values) if len(values) > 1 else None,
        statistics.median(values) if values else None,
    )


def mean_spl(rows: Iterable[Row]) -> float | None:
    """Return success weighted by path length, 0..1 (Anderson et al., arXiv:1807.06757); None if unknown."""
    return spread_of([row.spl or 0.0 for row in rows if row.shortest_path_m is not None]).mean


def summarise(algorithm: str, rows: Sequence[Row]) -> Summary:
    """Return what ``rows``, all of one algorithm and at least one, say of it."""
    outcomes = [row.outcome for row in rows]
    successes = sum(outcome in SUCCESSES for outcome in outcomes)
    low, high = wilson_interval(successes, len(rows))
    path_m = spread_of([row.path_m for row in rows if row.outcome in SUCCESSES and row.path_m is not None])
    return Summary(
        algorithm,
        len(rows),
        escaped=outcomes.count("escaped"),
        left_bounds=outcomes.count("left_bounds"),
        entrapped=outcomes.count("entrapped"),
        tipped=outcomes.count("tipped"),
        fault=outcomes.count("fault"),
        success_percent=100 * successes / len(rows),
        success_low_percent=100 * low,
        success_high_percent=100 * high,
        path_mean_m=path_m.mean,
        path_sd_m=path_m.sd,
        path_median_m=path_m.median,
        spl=mean_spl(rows),
        time_mean_s=spread_of([row.time_s for row in rows if row.time_s is not None]).mean,
        anomalies_mean=spread_of([row.anomalies for row in rows if row.anomalies is not None]).mean,
    )
