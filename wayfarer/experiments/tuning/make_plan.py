"""The plan of the search that a command's options ask for, with all of it checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.sweep import MOST_TRIALS
from wayfarer.experiments.tuning.forests import development
from wayfarer.experiments.tuning.objective import QUANTITIES, SPL
from wayfarer.experiments.tuning.plan import SearchPlan
from wayfarer.experiments.tuning.space import search_space
from wayfarer.extras import require


def make_plan(campaign: Campaign, ranges: Sequence[str], objective: str, proposals: int) -> SearchPlan:
    """Return the plan of a search for the only algorithm of a campaign; its forests are made here.

    Raises:
        BadInput: the space is not right, there are too many trials, or the forests cannot be divided.
        MissingPackage: shortest paths, for SPL, need a library that is not installed.
    """
    if len(campaign.algorithms) > 1:
        raise BadInput(f"a search is for one algorithm; choose one of {', '.join(campaign.algorithms)}")
    if (count := (1 + proposals) * campaign.trials) > MOST_TRIALS:
        raise BadInput(f"this search has up to {count:,} trials, allowed are {MOST_TRIALS:,}; take fewer --points")
    space, quantity = search_space(campaign, ranges), QUANTITIES[objective]
    if quantity is SPL and _lacks_shortest_paths(campaign):
        require("--spl")
        campaign = replace(campaign, spl=True)
    return SearchPlan(campaign, development(campaign), space, quantity, proposals)


def _lacks_shortest_paths(campaign: Campaign) -> bool:
    known = campaign.forests.forests if campaign.forests else ()
    return not known or any(forest.shortest_path_m is None for forest in known)
