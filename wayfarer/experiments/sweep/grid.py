"""The plan of a sweep: a grid of points, each a campaign with the same forests, noises and seeds.

What a trial meets follows from the campaign's seed and the trial's number, not from the point: points are paired.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.sweep.axes import Axis, Value
from wayfarer.experiments.sweep.keys import check_keys, current, laid_over_campaign

MOST_AXES = 2  # a curve or a map; more cannot be drawn
MOST_TRIALS = 1_000_000


class PointTask(NamedTuple):
    """One trial of one algorithm at one point; points and trials count from 0."""

    point: int
    algorithm: str
    trial: int


@dataclass(frozen=True, slots=True)
class SweepPoint:
    """A point of the grid: a value for each axis, and the campaign that they make."""

    values: tuple[Value, ...]
    campaign: Campaign


@dataclass(frozen=True, slots=True)
class Sweep:
    """All that decides the results of a sweep; the last axis varies fastest."""

    base: Campaign
    axes: tuple[Axis, ...]
    points: tuple[SweepPoint, ...]

    def tasks(self) -> list[PointTask]:
        """Return every trial in the order of ``trials.csv``."""
        campaign, points = self.base, range(len(self.points))
        return [PointTask(p, name, trial) for p in points for name in campaign.algorithms for trial in _trials(self)]

    def tasks_by_forest(self) -> Iterator[PointTask]:
        """Yield every trial in the order of running, so that a shortest path serves all points that share it."""
        campaign, points = self.base, range(len(self.points))
        return (PointTask(p, name, trial) for trial in _trials(self) for p in points for name in campaign.algorithms)

    def settings(self) -> dict[str, Any]:
        """Return the settings as JSON can hold them: what makes two sweeps the same one.

        ``now`` is what the campaign has for each key where it is not swept.
        """
        axes = [{"key": a.key, "values": list(a.values), "now": current(self.base, a.key)} for a in self.axes]
        return {"axes": axes, "campaign": self.base.settings()}


def make_sweep(base: Campaign, axes: Sequence[Axis]) -> Sweep:
    """Return the sweep of these axes over a campaign, all of its points checked.

    Raises:
        UnknownName: no such key; the text offers the nearest ones.
        BadConfig: a value is out of its range, or two do not go together.
        BadInput: too many keys or trials, or keys that do not go together.
    """
    if not 1 <= len(axes) <= MOST_AXES:
        raise BadInput(f"{len(axes)} keys to sweep: one gives curves, two give maps, more cannot be drawn")
    check_keys(base, [axis.key for axis in axes])
    count = math.prod(len(axis.values) for axis in axes) * len(base.algorithms) * base.trials
    if count > MOST_TRIALS:
        raise BadInput(f"this sweep has {count:,} trials, allowed are {MOST_TRIALS:,}; take fewer values or --trials")
    return Sweep(base, tuple(axes), tuple(_points(base, axes)))


def _points(base: Campaign, axes: Sequence[Axis]) -> Iterator[SweepPoint]:
    keys = [axis.key for axis in axes]
    for values in product(*(axis.values for axis in axes)):
        yield SweepPoint(values, laid_over_campaign(base, dict(zip(keys, values, strict=True))))


def _trials(sweep: Sweep) -> range:
    return range(sweep.base.trials)
