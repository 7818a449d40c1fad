"""Trials that need no simulator, in which two settings decide and the others do not."""

from __future__ import annotations

from dataclasses import replace
from math import log
from pathlib import Path

from tests.experiments import fake_trials
from wayfarer.experiments.campaign import ForestFile
from wayfarer.experiments.trial import TrialResult
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.experiments.tuning.forests import development
from wayfarer.experiments.tuning.objective import SPL, Quantity
from wayfarer.experiments.tuning.plan import SearchPlan
from wayfarer.experiments.tuning.space import search_space
from wayfarer.simhal.world.forest import CLEARING

BEST_ANGLE_DEG, WEDGED_BELOW_M = 45.0, 0.1
SPACE = ("escape.turn_angle_deg=10:90:log", "escape.back_off_m=0.05:0.5", "detector.cannot_turn_tries=1:6")
FORESTS = ForestFile(
    "clearings.jsonl", "0" * 32, tuple(replace(CLEARING, forest=number, shortest_path_m=40.0) for number in range(20))
)


def plan_of(
    proposals: int = 24, trials: int = 40, quantity: Quantity = SPL, space: tuple[str, ...] = SPACE
) -> SearchPlan:
    campaign = replace(fake_trials.campaign_of(trials), forests=FORESTS)
    return SearchPlan(campaign, development(campaign), search_space(campaign, space), quantity, proposals)


def trial(spec: TrialSpec, log_dir: Path | None = None, /) -> TrialResult:
    """The nearer the turn angle is to 45 degrees, the shorter is the path; with a small back-off some are wedged."""
    escape = spec.rover.escape
    path_m = 50.0 * (1.0 + abs(log(escape.turn_angle_deg / BEST_ANGLE_DEG))) * (1.0 + spec.seed % 1000 / 5000)
    wedged = escape.back_off_m < WEDGED_BELOW_M and spec.trial % 10 == 3
    return fake_trials.quick(spec)._replace(
        outcome="entrapped" if wedged else "escaped", path_m=path_m, time_s=1.2 * path_m, anomalies=int(path_m / 3),
        shortest_path_m=40.0, spl=0.0 if wedged else 40.0 / path_m,
    )  # fmt: skip
