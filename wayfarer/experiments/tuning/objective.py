"""What a search makes better, and what it measures beside that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from statistics import fmean
from typing import NamedTuple

from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.rows import TrialRow


class Quantity(NamedTuple):
    """A figure of a trial: its name, title, decimals, whether more of it is better, and how to read it from a row."""

    name: str
    title: str
    decimals: int
    more_is_better: bool
    of: Callable[[TrialRow], float | None]

    @property
    def sign(self) -> int:
        """1 where more is better, else -1."""
        return 1 if self.more_is_better else -1

    def mean(self, rows: Sequence[TrialRow]) -> float | None:
        """Return the mean over the trials in which it is known."""
        known = [value for row in rows if (value := self.of(row)) is not None]
        return fmean(known) if known else None


# Time and anomalies are of all trials, as in the table of ``wayfarer sim``: a failure counts with what it took.
SPL = Quantity("spl", "SPL", 3, True, attrgetter("counted_spl"))
TIME = Quantity("time", "time, s", 1, False, attrgetter("time_s"))
ANOMALIES = Quantity("anomalies", "anomalies", 1, False, attrgetter("anomalies"))
PATH = Quantity("path", "path, m", 1, False, attrgetter("escape_path_m"))
QUANTITIES = {each.name: each for each in (SPL, PATH, TIME, ANOMALIES)}


# The interval is by a bootstrap of layouts, which is too narrow with few of them, and has no width with one (B. Efron,
# R. Tibshirani, "An Introduction to the Bootstrap", 1993, chapter 13). From no source: that ten are enough.
LEAST_LAYOUTS = 10


def layouts(rows: Sequence[TrialRow]) -> int:
    """Count the layouts in which trials took place."""
    return len({row.forest for row in rows})


def failures(rows: Sequence[TrialRow]) -> int:
    """Count the trials that did not get out: entrapped, tipped, or ended by a fault."""
    return sum(row.outcome not in SUCCESSES for row in rows)
