"""How many have escaped by which distance, without forgetting those that never did."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from wayfarer.simhal.rows import SUCCESSES, Row


class Step(NamedTuple):
    """From this path on, metres, the estimated share of trials that have escaped, 0..1."""

    path_m: float
    escaped: float


class Curve(NamedTuple):
    """A cumulative share as the steps where it grows, and the paths at which trials were lost from sight."""

    steps: list[Step]
    censored_m: list[float]

    @property
    def escaped(self) -> float:
        """The share at the end, 0..1."""
        return self.steps[-1].escaped if self.steps else 0.0


def kaplan_meier(escaped_m: Sequence[float], censored_m: Sequence[float]) -> Curve:
    """Return the product-limit estimate of the share that has escaped (E. L. Kaplan, P. Meier, JASA 53, 1958).

    A trial that is censored at a distance counts as under way up to there, that distance included.
    """
    escapes, ends = Counter(escaped_m), Counter([*escaped_m, *censored_m])
    steps: list[Step] = []
    at_risk, under_way = len(escaped_m) + len(censored_m), 1.0
    for path_m in sorted(ends):
        if path_m in escapes:
            under_way *= 1.0 - escapes[path_m] / at_risk
            steps.append(Step(path_m, 1.0 - under_way))
        at_risk -= ends[path_m]
    return Curve(steps, sorted(censored_m))


def escape_curve(rows: Iterable[Row]) -> Curve:
    """Return the curve of some trials; those of unknown path, as after a crash, say nothing of distance."""
    known = [(row.outcome in SUCCESSES, row.path_m) for row in rows if row.path_m is not None]
    return kaplan_meier(
        [path_m for success, path_m in known if success],
        [path_m for success, path_m in known if not success],
    )
