"""Paired comparison of two algorithms on the same forests and noise, with intervals.

Trials are paired by (forest, noise). The noises of one layout are not independent of each other, so the bootstrap draws
whole layouts. Entrapment is rare: its interval is exact (Clopper and Pearson, Biometrika 26, 1934), so that none in
1,000 still says "up to 0.37 %".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from wayfarer.errors import BadInput
from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import Estimate, spread_of

RESAMPLES = 4000
MOST_DRAWN = 1_000_000  # clusters at a time, for the memory's sake
TAIL = 0.025  # on either side of a 95 % interval

PairKey = tuple[int, int]
USUAL_BASELINE = "forest-pledge"  # the paper's best


class Difference(NamedTuple):
    """A mean difference over pairs with its 95 % interval, in the value's unit, and how likely none is.

    ``p`` is two-sided, by the same bootstrap as the interval: twice the smaller share of the resampled means on one
    side of 0, a resample more counted on each side, so that it is never 0 (A. C. Davison, D. V. Hinkley, "Bootstrap
    Methods and their Application", 1997, section 4.4).
    """

    estimate: Estimate
    p: float
    pairs: int


@dataclass(frozen=True, slots=True)
class Comparison:
    """One algorithm, and what it is beside the one that it was compared with.

    ``success_gain`` is over all pairs, in percentage points; ``spl_gain`` over all pairs whose shortest path is known,
    a failure counting 0; ``path_gain_m``, metres, negative where this one is shorter, over the pairs in which both got
    out. They are None without such pairs, and for the algorithm that the others are compared with. ``entrapped`` and
    ``left_bounds`` are shares of the trials, 0..1.
    ``worst`` is a trial that did not get out, else the longest path.
    """

    algorithm: str
    trials: int
    layouts: int
    success_gain: Difference | None
    spl: float | None
    spl_gain: Difference | None
    path_gain_m: Difference | None
    entrapped: Estimate
    left_bounds: Estimate
    worst: TrialRow


def compare(rows: Sequence[TrialRow], against: str | None = None) -> list[Comparison]:
    """Compare every algorithm of a campaign with one of them, which comes first.

    Where none is named that is Forest-Pledge, else the campaign's first one.

    Raises:
        BadInput: that one is not there, is alone, or two trials have the same algorithm, forest and noise.
    """
    trials: dict[str, dict[PairKey, TrialRow]] = {}
    for row in rows:
        if trials.setdefault(row.algorithm, {}).setdefault((row.forest, row.noise), row) is not row:
            raise BadInput(
                f"{row.algorithm} has two trials in forest {row.forest} with noise {row.noise}, so its trials cannot "
                "be paired; give each line of the forest file its own forest and noise"
            )
    if against is None:
        against = USUAL_BASELINE if USUAL_BASELINE in trials else next(iter(trials))
    if against not in trials:
        raise BadInput(f"no trial of '{against}' to compare with; --against takes one of {', '.join(trials)}")
    if len(trials) == 1:
        raise BadInput(f"{against} is alone; run it with others: wayfarer sim --algorithm {against},pledge")
    base = trials.pop(against)
    return [_compared(against, base, None), *(_compared(name, own, base) for name, own in trials.items())]


def _compared(name: str, own: dict[PairKey, TrialRow], base: dict[PairKey, TrialRow] | None) -> Comparison:
    rows = list(own.values())
    pairs = [(row, base[key]) for key, row in own.items() if key in base] if base else []
    return Comparison(
        name,
        len(rows),
        len({row.forest for row in rows}),
        _gain(pairs, lambda row: 100.0 * (row.outcome in SUCCESSES)),
        spread_of([spl for row in rows if (spl := row.counted_spl) is not None]).mean,
        _gain(pairs, attrgetter("counted_spl")),
        _gain(pairs, attrgetter("escape_path_m")),
        _share(rows, "entrapped"),
        _share(rows, "left_bounds"),
        max(rows, key=lambda row: (row.outcome not in SUCCESSES, row.path_m or 0.0)),
    )


def _gain(pairs: Iterable[tuple[TrialRow, TrialRow]], value: Callable[[TrialRow], float | None]) -> Difference | None:
    """Return the mean difference of a value over the pairs that have it on both sides; None if none has."""
    gains: dict[int, list[float]] = {}
    for own, other in pairs:
        here, there = value(own), value(other)
        if here is not None and there is not None:
            gains.setdefault(own.forest, []).append(here - there)
    return cluster_bootstrap(list(gains.values())) if gains else None


def cluster_bootstrap(clusters: Sequence[Sequence[float]], resamples: int = RESAMPLES) -> Difference:
    """Return the mean of all values, and its 95 % percentile interval and p when whole clusters are resampled.

    The draws are always the same, so that a table can be made again.
    """
    sums = np.array([math.fsum(values) for values in clusters])
    counts = np.array([len(values) for values in clusters])
    draw = np.random.Generator(np.random.PCG64(0)).integers
    means = np.empty(resamples)
    together = max(1, MOST_DRAWN // len(clusters))
    for first in range(0, resamples, together):
        part = means[first : first + together]
        drawn = draw(len(clusters), size=(len(part), len(clusters)))
        part[:] = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(means, (TAIL, 1.0 - TAIL)).tolist()
    one_sided = 1 + min(np.count_nonzero(means <= 0.0), np.count_nonzero(means >= 0.0))
    p = min(1.0, 2.0 * float(one_sided) / (resamples + 1))
    return Difference(Estimate(float(sums.sum() / counts.sum()), low, high), p, int(counts.sum()))


def _share(rows: Sequence[TrialRow], outcome: str) -> Estimate:
    count = sum(row.outcome == outcome for row in rows)
    return Estimate(count / len(rows), *exact_interval(count, len(rows)))


def exact_interval(successes: int, trials: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a proportion, within 0..1.

    Raises:
        ValueError: more successes than trials.
    """
    from scipy.stats import binomtest  # it takes a second to import, which only a comparison is to pay

    interval = binomtest(successes, trials).proportion_ci(method="exact")
    return float(interval.low), float(interval.high)
