"""Statistics of campaigns: success with its interval, path lengths, SPL; and the measures that a sweep compares."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wayfarer.experiments.outcome import OUTCOMES, SUCCESSES
from wayfarer.experiments.rows import TrialRow

AVERAGED = ("counted_spl", "time_s", "anomalies", "interventions", "overturned", "off_wheels")
Z_95 = statistics.NormalDist().inv_cdf(0.975)


class Estimate(NamedTuple):
    """A value and its 95 % interval, in the value's unit."""

    value: float
    low: float
    high: float

    def text(self, decimals: int, sign: str = "") -> str:
        """Return the value with its interval in brackets; with ``+`` for a sign each number has one."""
        value, low, high = (f"{number:{sign}.{decimals}f}" for number in self)
        return f"{value} [{low}, {high}]"


class SampleSpread(NamedTuple):
    """Mean, sample standard deviation and median; None if there are too few values."""

    mean: float | None
    sd: float | None
    median: float | None


@dataclass(frozen=True, slots=True)
class AlgorithmSummary:
    """One algorithm's line of the table.

    Path lengths are in metres, over the successes (escaped or left the map), as in the paper. ``spl`` is the
    mean over all trials whose shortest path is known, where a failure counts 0. Time (simulated, in seconds)
    and anomalies are means a trial, faults left out; ``escape_..._s`` is the time of the successes. Interventions are
    the mean per trial, if they are counted, ``overturned`` and ``off_wheels`` those of each kind.
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
    escape_mean_s: float | None
    escape_sd_s: float | None
    escape_median_s: float | None
    interventions_mean: float | None
    overturned_mean: float | None
    off_wheels_mean: float | None


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % score interval of a proportion, within 0..1 (E. B. Wilson, JASA 22, 1927).

    Every table has it: in closed form, because ``scipy.stats`` takes a second to import.

    Raises:
        ValueError: no trials, or more successes than trials.
    """
    if not 0 <= successes <= trials or trials == 0:
        raise ValueError(f"{successes} successes in {trials} trials")
    share, spread = successes / trials, Z_95**2 / trials
    centre = share + spread / 2
    half = math.sqrt(spread * (share * (1 - share) + spread / 4))
    return max(0.0, (centre - half) / (1 + spread)), min(1.0, (centre + half) / (1 + spread))


def spread_of(values: Sequence[float]) -> SampleSpread:
    """Return mean, sample standard deviation and median of ``values``, in their own unit.

    Without numpy: to import it for one table takes as long as the median of 300,000 values.
    """
    return SampleSpread(
        statistics.fmean(values) if values else None,
        statistics.stdev(values) if len(values) > 1 else None,
        statistics.median(values) if values else None,
    )


def summarise(algorithm: str, rows: Iterable[TrialRow]) -> AlgorithmSummary:
    """Return what ``rows``, all of one algorithm and at least one, say of it.

    SPL is success weighted by path length, 0..1 (Anderson et al., arXiv:1807.06757).
    """
    rows = list(rows)
    outcomes = Counter(row.outcome for row in rows)

    def known(name: str) -> list[float]:
        return [value for row in rows if (value := getattr(row, name)) is not None]

    path_m, escape_s = spread_of(known("escape_path_m")), spread_of(known("escape_s"))
    means = {name: statistics.fmean(values) if (values := known(name)) else None for name in AVERAGED}
    trials, successes = outcomes.total(), sum(outcomes[outcome] for outcome in SUCCESSES)
    low, high = wilson_interval(successes, trials)
    return AlgorithmSummary(
        algorithm,
        trials,
        **{outcome: outcomes[outcome] for outcome in OUTCOMES},
        success_percent=100 * successes / trials,
        success_low_percent=100 * low,
        success_high_percent=100 * high,
        path_mean_m=path_m.mean,
        path_sd_m=path_m.sd,
        path_median_m=path_m.median,
        spl=means["counted_spl"],
        time_mean_s=means["time_s"],
        anomalies_mean=means["anomalies"],
        escape_mean_s=escape_s.mean,
        escape_sd_s=escape_s.sd,
        escape_median_s=escape_s.median,
        interventions_mean=means["interventions"],
        overturned_mean=means["overturned"],
        off_wheels_mean=means["off_wheels"],
    )


# -- the measures at each point of a sweep, with 95 % intervals --------------------------------------------------------


def estimated_share(rows: Sequence[TrialRow], outcomes: Sequence[str]) -> Estimate:
    """Return how many of the trials, at least one, ended so, in percent, with Wilson's interval."""
    count = sum(row.outcome in outcomes for row in rows)
    low, high = wilson_interval(count, len(rows))
    return Estimate(100.0 * count / len(rows), 100.0 * low, 100.0 * high)


def estimated_mean(values: Iterable[float | None]) -> Estimate | None:
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
    Measure("success", "success, %", 1, lambda rows: estimated_share(rows, SUCCESSES)),
    Measure("spl", "SPL", 3, lambda rows: estimated_mean(row.counted_spl for row in rows)),
    Measure("path", "path, m", 1, lambda rows: estimated_mean(row.escape_path_m for row in rows)),
    Measure("time", "time, s", 1, lambda rows: estimated_mean(row.escape_s for row in rows)),
    Measure("left_bounds", "left the map, %", 1, lambda rows: estimated_share(rows, ("left_bounds",))),
    Measure(
        "interventions", "interventions a trial", 2, lambda rows: estimated_mean(row.interventions for row in rows)
    ),
)


def spl_difference(rows: Sequence[TrialRow], others: Sequence[TrialRow]) -> Estimate | None:
    """Return by how much the SPL exceeds that of the same trials at another point; None if it is unknown."""
    pairs = ((row.counted_spl, other.counted_spl) for row, other in zip(rows, others, strict=True))
    return estimated_mean([here - there for here, there in pairs if here is not None and there is not None])
