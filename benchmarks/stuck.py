"""Why rovers do not get out of the clutter: the failures of Forest-Pledge, each classed by its true path.

The layouts are those of the tables of the sites: ``docs/explanation/scenarios.md`` has what came out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

import numpy as np

from wayfarer import run_campaign, run_trial

SEEDS = (1, 2, 3, 4)
WEDGED_M, WEDGED_S = 0.3, 90.0  # it stays so near to a place for so long
CLIMBING_INTERVENTIONS = 20  # at least: it climbs the same branches again and again
LATE_S = 150.0  # half of the time: before that a rover cannot be said to orbit
AGAIN_M, AGAIN_S = 0.15, 30.0  # it is so near to where it was so long before
CLASSES = ("orbits", "wedged", "at new places", "climbs")
HEADER = ("rover", "trials", "failed", *CLASSES)


def rows(trials: int) -> Iterator[Sequence[str]]:
    """Yield how many of each rover's trials failed, and how; ``trials`` with each seed."""
    for rover in ("forestrover", "minirover"):
        found = Counter[str]()
        for seed in SEEDS:
            clutter: dict[str, Any] = {"site": "dense-obstruction", "rover": rover, "seed": seed}
            campaign = run_campaign("forest-pledge", trials=trials, **clutter)
            failed = [row["trial"] for row in campaign.trials if row["outcome"] == "entrapped"]
            with ProcessPoolExecutor() as pool:
                found.update(pool.map(partial(_class_of, clutter), failed))
        counts = (found.total(), *(found[each] for each in CLASSES))
        yield rover, str(trials * len(SEEDS)), *map(str, counts)


def _class_of(clutter: Mapping[str, Any], number: int) -> str:
    """Run a trial again, and say how it failed."""
    trial = run_trial(number, "forest-pledge", **clutter)
    t_s = np.array([tick["t_s"] for tick in trial.track])
    way_m = np.array([complex(tick["x_m"], tick["y_m"]) for tick in trial.track])
    for at in range(0, len(t_s), 20):  # each second
        away = np.flatnonzero(abs(way_m[at:] - way_m[at]) > WEDGED_M)
        if t_s[at + away[0] if away.size else -1] - t_s[at] > WEDGED_S:
            return "wedged"
    if (trial.row.interventions or 0) >= CLIMBING_INTERVENTIONS:
        return "climbs"
    late = range(int(np.searchsorted(t_s, LATE_S)), len(t_s), 10)
    again = [(abs(way_m[t_s < t_s[at] - AGAIN_S] - way_m[at]) < AGAIN_M).any() for at in late]
    return "orbits" if np.mean(again) > 0.5 else "at new places"
