"""Estimate of the time that a campaign still takes: an algorithm's trial can cost ten times another one's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

# Time of a trial relative to forest-pledge's: the mean simulated time that `wayfarer sim --algorithm paper
# --trials 500 --forests reference` prints. Real time follows it: a control tick of each of the ten costs 1.0 to 1.2 of
# forest-pledge's (43 forests, compiled). What is not here counts as 1.
RELATIVE_COST: Mapping[str, float] = {
    "pledge": 1.1, "rand-pledge": 1.5, "cv-pledge": 1.2, "oo-pledge": 1.0, "levy-pledge": 1.4,
    "levy-walk": 8.0, "cv-levy": 7.2, "cv-react": 10.0, "oo-react": 9.6,
}  # fmt: skip
PRIOR_TRIALS = 10  # a table that is wrong by a third, and trials that scatter by their mean: (1 / 0.33)^2 outweigh it


def relative_cost(algorithm: str) -> float:
    """Return how long a trial of an algorithm takes by the table, relative to one of forest-pledge."""
    return RELATIVE_COST.get(algorithm, 1.0)


class TimeLeft:
    """Estimates the time left from the trials that are done.

    The cost of an algorithm is the mean of its trials so far. The table counts beside them as ``PRIOR_TRIALS`` trials,
    scaled to what this campaign takes, so that the first trials of an algorithm do not make the estimate jump.

    Args:
        missing: how many trials of each algorithm are to be run.
        jobs: how many run at a time; workers of a cluster that come later are not counted.
    """

    def __init__(self, missing: Mapping[str, int], jobs: int) -> None:
        self._missing = Counter(missing)
        self._jobs = jobs
        self._done: Counter[str] = Counter()
        self._took_s = dict.fromkeys(missing, 0.0)

    def take(self, algorithm: str, took_s: float) -> None:
        """Count a trial that is done, and took so many seconds."""
        self._missing[algorithm] -= 1
        self._done[algorithm] += 1
        self._took_s[algorithm] += took_s

    @property
    def left_s(self) -> float | None:
        """Seconds until the last trial ends; None before the first one has."""
        if not self._done:
            return None
        unit_s = sum(self._took_s.values()) / sum(relative_cost(name) * n for name, n in self._done.items())
        at_a_time = min(self._jobs, max(1, self._missing.total()))
        return sum(n * self._mean_s(name, unit_s) for name, n in self._missing.items()) / at_a_time

    def _mean_s(self, algorithm: str, unit_s: float) -> float:
        prior_s = PRIOR_TRIALS * unit_s * relative_cost(algorithm)
        return (prior_s + self._took_s[algorithm]) / (PRIOR_TRIALS + self._done[algorithm])
