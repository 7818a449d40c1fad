"""The plan of a search: all that decides its study, and the campaign at each point that was proposed so far."""

from __future__ import annotations

import platform
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import optuna

from wayfarer.experiments.campaign import Campaign, Tasks
from wayfarer.experiments.tuning.objective import Quantity
from wayfarer.experiments.tuning.space import SearchRange


@dataclass(frozen=True)
class SearchPlan:
    """A search over ``space`` for so many ``proposals``.

    ``asked`` is a campaign of one algorithm with the forests that a person named, and ``base`` the same on those of
    them that are for the search. ``points`` are the campaigns to run: the present settings first, then the proposals,
    as the search makes them.
    """

    asked: Campaign
    base: Campaign
    space: tuple[SearchRange, ...]
    quantity: Quantity
    proposals: int
    points: list[Campaign] = field(default_factory=list)

    @property
    def algorithm(self) -> str:
        """The one that is searched for."""
        return self.base.algorithms[0]

    def settings(self) -> dict[str, Any]:
        """Return the settings as JSON can hold them: what makes two searches the same one.

        Who proposes is one of them: another version could propose other points, whose trials the kept ones are not.
        """
        return {
            "space": [each._asdict() for each in self.space],
            "objective": self.quantity.name,
            "points": 1 + self.proposals,
            "proposed_by": f"optuna {optuna.__version__}, numpy {np.__version__}, {platform.machine()}",
            "campaign": self.base.settings(),
        }

    def tasks(self) -> Tasks:
        """Return every trial that the search could run."""
        return Tasks(self.base.algorithms, self.base.trials, 1 + self.proposals)
