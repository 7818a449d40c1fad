"""Heavy-tailed random draws: the Lévy distribution of the paper's stochastic algorithms."""

from __future__ import annotations

from random import Random
from statistics import NormalDist

_NORMAL = NormalDist()


def levy(rng: Random, scale: float) -> float:
    """Draw from Lévy(0, scale): positive, no mean, half of the draws above 2.2 times the scale.

    A Lévy variable is ``scale / z**2`` for a standard normal z; the quantile form needs one uniform draw.
    """
    z = _NORMAL.inv_cdf((1.0 - rng.random()) / 2.0)  # never 0, which has no quantile
    return scale / (z * z) if z else float("inf")


def clipped_levy(rng: Random, scale: float, low: float, high: float) -> float:
    """Draw from Lévy(0, scale), clipped to [low, high]."""
    return min(max(levy(rng, scale), low), high)
