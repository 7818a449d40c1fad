"""The plan of a sweep: a grid of points, each a campaign with the same forests, noises and seeds.

What a trial meets follows from the campaign's seed and the trial's number, not from the point: points are paired.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.sweep.axes import MOST_AXES, Axis
from wayfarer.experiments.sweep.keys import check_keys, current, laid_over_campaign

MOST_TRIALS = 1_000_000


@dataclass(frozen=True, slots=True)
class Sweep:
    """All that decides the results of a sweep: a campaign, what varies, and the campaign at each point.

    The last axis varies fastest.
    """

    base: Campaign
    axes: tuple[Axis, ...]
    points: tuple[Campaign, ...]

    def settings(self) -> dict[str, Any]:
        """Return the settings as JSON can hold them: what makes two sweeps the same one.

        ``now`` is what the campaign has for each key where it is not swept.
        """
        now = current(self.base)
        axes = [{"key": a.key, "values": list(a.values), "now": now.get(a.key)} for a in self.axes]
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
    keys, values = [axis.key for axis in axes], product(*(axis.values for axis in axes))
    points = (laid_over_campaign(base, dict(zip(keys, each, strict=True))) for each in values)
    return Sweep(base, tuple(axes), tuple(points))
