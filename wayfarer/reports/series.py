"""Prepares columns of numbers for drawing: lines with a gap where data are missing, thin enough for a page."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.reports.data import Columns, Floats

BINS = 3000  # of a line: one for 1.2 s of an hour, and some in each column of pixels of a screen

Line = tuple[Floats, Floats]  # times in seconds, and values


class ValueSpan(NamedTuple):
    """A time in which a value stays the same."""

    start_s: float
    end_s: float
    value: float


def breaks(columns: Columns) -> NDArray[np.bool_]:
    """Return between which rows the log breaks off."""
    between: NDArray[np.bool_] = np.diff(columns["stretch"]) != 0.0
    return between


def at_ticks(ticks: Columns, values: Floats) -> Line:
    """Return the line of a value that each tick has."""
    return broken(ticks["t_s"], values, breaks(ticks))


def around(line: Line, centre_deg: float) -> Line:
    """Return angles as deviations from a centre, -180 to 180 degrees, broken where they go round the back."""
    deviations_deg = (line[1] - centre_deg + 180.0) % 360.0 - 180.0  # as angles.wrap180, of an array
    return broken(line[0], deviations_deg, np.abs(np.diff(deviations_deg)) > 180.0)


def thinned(line: Line, bins: int = BINS) -> Line:
    """Return the smallest and the largest value in each of so many equal times, and every gap."""
    t_s, values = line
    unknown = np.isnan(values)
    again = unknown & np.append(False, unknown[:-1])  # one of several unknown values makes the same gap
    t_s, values, unknown = t_s[~again], values[~again], unknown[~again]
    if t_s.size <= 2 * bins:
        return t_s, values
    part = np.minimum((t_s - t_s[0]) / (t_s[-1] - t_s[0]) * bins, bins - 1).astype(np.intp)
    # A group is what is known within one of the times; sorted by value within it, its first and last are the extremes.
    group = np.cumsum(np.append(0, (np.diff(part) != 0) | (np.diff(unknown) != 0)))
    order = np.lexsort((values, group))
    firsts = np.flatnonzero(np.append(True, np.diff(group[order]) != 0))
    lasts = np.append(firsts[1:] - 1, order.size - 1)
    kept = np.unique(np.concatenate([order[firsts], order[lasts], np.flatnonzero(unknown)]))
    # A value that stays the same needs one point in each of the times.
    stays = np.equal(values[kept][1:-1], values[kept][:-2]) & np.equal(values[kept][1:-1], values[kept][2:])
    kept = kept[~np.pad(stays, 1) | np.isin(kept, order[firsts])]
    return t_s[kept], values[kept]


def spans(ticks: Columns, values: Floats, most: int = BINS) -> list[ValueSpan]:
    """Return the times in which a value of the ticks stays the same, at most ``most``; unknown values have none.

    A value holds until the next tick; the last one, and one before a break, until its own tick.
    """
    t_s = ticks["t_s"]
    if not t_s.size:
        return []
    ends_s = np.append(np.where(breaks(ticks), t_s[:-1], t_s[1:]), t_s[-1])
    found = list(_runs(t_s, ends_s, values))
    if len(found) <= most:
        return found
    grid_s = np.linspace(t_s[0], t_s[-1], most + 1)
    at = np.clip(np.searchsorted(t_s, grid_s[:-1], side="right") - 1, 0, t_s.size - 1)
    return list(_runs(grid_s[:-1], grid_s[1:], values[at]))


def pieces(inside: NDArray[np.bool_], *columns: Floats) -> list[Floats]:
    """Return the parts of a path that begin at points inside, as one line with gaps; each goes on to the next point."""
    changes = np.flatnonzero(np.diff(np.concatenate(([0], inside[:-1], [0]))))
    parts = [slice(first, end + 1) for first, end in changes.reshape(-1, 2)]
    return [np.concatenate([[], *(np.append(column[part], np.nan) for part in parts)]) for column in columns]


def broken(t_s: Floats, values: Floats, between: NDArray[np.bool_]) -> Line:
    """Return a line with a gap between two points where there shall be one."""
    at = np.flatnonzero(between) + 1
    return np.insert(t_s, at, t_s[at]), np.insert(values, at, np.nan)


def _runs(starts_s: Floats, ends_s: Floats, values: Floats) -> Iterator[ValueSpan]:
    """Yield a span for each run of equal values that follow each other without a gap."""
    new = (values[1:] != values[:-1]) | (starts_s[1:] > ends_s[:-1] + 1e-9)
    bounds = np.concatenate(([0], np.flatnonzero(new) + 1, [values.size]))
    for first, end in pairwise(bounds):
        if not np.isnan(values[first]):
            yield ValueSpan(float(starts_s[first]), float(ends_s[end - 1]), float(values[first]))
