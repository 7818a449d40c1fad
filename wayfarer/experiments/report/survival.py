"""Share of trials that have escaped by each distance, counting those that never did."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from wayfarer.experiments.rows import SUCCESSES, TrialRow


class CurveStep(NamedTuple):
    """From this path on, metres, the share of all trials that have escaped, 0..1."""

    path_m: float
    escaped: float


class Curve(NamedTuple):
    """A cumulative share as the steps where it grows, and the paths at which trials ended without an escape."""

    steps: list[CurveStep]
    failed_m: list[float]

    @property
    def escaped(self) -> float:
        """The share at the end, 0..1."""
        return self.steps[-1].escaped if self.steps else 0.0


def escape_curve(rows: Iterable[TrialRow]) -> Curve:
    """Return the cumulative incidence of escape: which share of all trials has escaped by a path of that length.

    A failure is an end like an escape, not a trial that was lost from sight: it counts as not escaped at any length.
    (Kaplan-Meier would let those under way make up for it, and ends above the share of successes: J. P. Fine, R. J.
    Gray, JASA 94, 1999, on competing risks.) So the curve ends at the success of the results' table.
    """
    rows = list(rows)
    escapes = Counter(row.path_m for row in rows if row.outcome in SUCCESSES and row.path_m is not None)
    steps, escaped = [], 0
    for path_m in sorted(escapes):
        escaped += escapes[path_m]
        steps.append(CurveStep(path_m, escaped / len(rows)))
    return Curve(steps, sorted(row.path_m for row in rows if row.outcome not in SUCCESSES and row.path_m is not None))
