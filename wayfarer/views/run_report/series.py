"""Prepares columns of numbers for drawing: a line has a gap where data are missing. matplotlib thins it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.views.run_report.data import GAP_S, Floats

BINS = 900  # two columns of pixels, or a third of a point on paper, for each


class ValueSpan(NamedTuple):
    """A time in which a value stays the same."""

    start_s: float
    end_s: float
    value: float


def broken_at_gaps(t_s: Floats, values: Floats, gap_s: float = GAP_S) -> tuple[Floats, Floats]:
    """Return a line that does not bridge a time in which nothing was logged."""
    return _broken(t_s, values, np.diff(t_s) > gap_s)


def broken_beside(ticks_s: Floats, t_s: Floats, values: Floats, silent_s: float) -> tuple[Floats, Floats]:
    """Return a line of something that is told more seldom than ticks; it bridges neither their gaps nor a silence."""
    gaps_s = ticks_s[:-1][np.diff(ticks_s) > GAP_S]
    return _broken(t_s, values, (np.diff(np.searchsorted(gaps_s, t_s)) > 0) | (np.diff(t_s) > silent_s))


def around(t_s: Floats, angles_deg: Floats, centre_deg: float) -> tuple[Floats, Floats]:
    """Return angles as deviations from a centre, -180 to 180 degrees, broken where they go round the back."""
    deviations_deg = (angles_deg - centre_deg + 180.0) % 360.0 - 180.0
    return _broken(t_s, deviations_deg, np.abs(np.diff(deviations_deg)) > 180.0)


def without_unknown(t_s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return only what is known: the readings of a sensor that speaks less often than the tick."""
    known = ~np.isnan(values)
    return t_s[known], values[known]


def spans(t_s: Floats, values: Floats, samples: int = BINS) -> list[ValueSpan]:
    """Return the times in which a value stays the same, at most ``samples`` of them; unknown values have none.

    The last value is taken to hold for as long as the tick before it did.
    """
    if not t_s.size:
        return []
    ends_s = np.append(t_s[1:], t_s[-1] + (t_s[-1] - t_s[-2] if t_s.size > 1 else 0.0))
    ends_s = np.where(ends_s - t_s > GAP_S, t_s, ends_s)
    found = list(_runs(t_s, ends_s, values))
    if len(found) <= samples:
        return found
    grid_s = np.linspace(t_s[0], t_s[-1], samples + 1)
    at = np.clip(np.searchsorted(t_s, grid_s[:-1], side="right") - 1, 0, t_s.size - 1)
    return list(_runs(grid_s[:-1], grid_s[1:], values[at]))


def pieces(columns: tuple[Floats, Floats], inside: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Return the parts of a way that begin at points inside, as one line with gaps; each goes on to the next point."""
    changes = np.flatnonzero(np.diff(np.concatenate(([0], inside[:-1], [0]))))
    parts = [slice(first, end + 1) for first, end in changes.reshape(-1, 2)]
    first, second = (np.concatenate([[], *(np.append(column[part], nan) for part in parts)]) for column in columns)
    return first, second


def _runs(starts_s: Floats, ends_s: Floats, values: Floats) -> Iterator[ValueSpan]:
    """Yield a span for each run of equal values that follow each other without a gap."""
    new = (values[1:] != values[:-1]) | (starts_s[1:] > ends_s[:-1] + 1e-9)
    bounds = np.concatenate(([0], np.flatnonzero(new) + 1, [values.size]))
    for first, end in pairwise(bounds):
        if not np.isnan(values[first]):
            yield ValueSpan(float(starts_s[first]), float(ends_s[end - 1]), float(values[first]))


def _broken(t_s: Floats, values: Floats, between: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    at = np.flatnonzero(between) + 1
    return np.insert(t_s, at, t_s[at]), np.insert(values, at, nan)
