"""Which runs are over the limits that a person has set, and how old runs are where clocks were wrong. Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from wayfarer.config.rover_file import LogSettings
from wayfarer.fieldlog.clock import CLOCK_SET_S

DAY_S = 86_400.0
# No clock that runs is this far wrong, and few rovers rest for so long: one that steps further was or is not set.
STEP_S = 183 * DAY_S


class StoredRun(NamedTuple):
    """A run on the disk: its folder's name, its size, when it was last written, and whether it is only a run."""

    name: str
    mb: float
    wall_s: float
    deletable: bool


def over_limits(
    runs: Sequence[StoredRun],
    settings: LogSettings,
    now_wall_s: float,
    may_go: Callable[[str], bool] = lambda _: True,
) -> list[StoredRun]:
    """Return which runs are to go, oldest first, from all of them in their order.

    ``may_go`` is asked last, by the name of a run that would go: looking for marks takes seconds.
    """
    if now_wall_s < CLOCK_SET_S:
        return []
    keep_days, keep_mb = settings.keep_days, settings.keep_mb
    left_mb = sum(run.mb for run in runs)
    over = []
    for run, age_s in zip(runs[:-1], ages_s([run.wall_s for run in runs], now_wall_s), strict=False):
        too_old = keep_days is not None and age_s > keep_days * DAY_S
        too_much = keep_mb is not None and left_mb > keep_mb
        if run.deletable and age_s > DAY_S and (too_old or too_much) and may_go(run.name):
            over.append(run)
            left_mb -= run.mb
    return over


def ages_s(times_s: Sequence[float], now_s: float) -> list[float]:
    """Return how old runs are, in seconds, from the wall times at which they were last written, in their order.

    The order is that of the counters, which no clock turns back. Time passes only where a later run has a later time. A
    clock that was never set says nothing; a step of over ``STEP_S`` in either direction counts as no time at all,
    because nobody knows which side of it is right. So a wrong clock makes runs younger, which keeps them.
    """
    passed_s, latest_s = 0.0, None
    then_s = []
    for time_s in (*times_s, now_s):
        if time_s >= CLOCK_SET_S:
            if latest_s is None or abs(time_s - latest_s) > STEP_S:
                latest_s = time_s
            elif time_s > latest_s:
                passed_s += time_s - latest_s
                latest_s = time_s
        then_s.append(passed_s)
    return [passed_s - each_s for each_s in then_s[:-1]]
