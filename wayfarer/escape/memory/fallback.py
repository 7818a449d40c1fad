"""Says when Pledge drives in place of the plan, so that the rover gets out wherever Pledge gets out.

The free-space assumption can be wrong again and again, and dead reckoning drifts. So a plan has a budget: a number of
contacts without progress, which is a new furthest place along the goal heading. Then Pledge drives, with a fresh
counter and without the map, for a budget as large; then the plan again, with both budgets doubled. Any progress starts
again with the first budget. Where contacts are crowded, Forest-Pledge drives in the place of the first plan: it is
quicker there than Pledge, which has to take back each turn. The guarantee does not need it.

*Why it gets out*: let N be the largest number of contacts that Pledge needs to get out of the wood, from any place in
it. Progress can happen only as often as the wood is deep in units of ``PROGRESS``. After the last one, the budgets
double until Pledge has N contacts, and gets out. Before that, all stints together had less than 6 N contacts, or the
first budget if that is more. Who drives within the first budget does not matter, so neither does a crowd; and a second
try (``slip``) adds at most one stop to each contact, because stopped again at the same place is a contact.

*What it assumes*: dead reckoning does not invent progress for ever, and nothing resets the algorithm. The ladder
(``escape.ladder``) does where the rover makes no progress at all, and takes budgets and Pledge's counter alike.
"""

from __future__ import annotations

from collections import deque
from typing import Final

# Progress, in widths of the body.
PROGRESS: Final = 2.5
# Where the rover drives less than CROWDED from contact to contact, in widths, over CONTACTS, a plan is no better
# than Pledge, and takes longer turns; until it drives more than FREE. In clutter, Pledge drives 0.7 m a contact with a
# body of 0.38 m; along a trunk, a plan drives 3 to 6 widths.
CROWDED: Final = 2.0
FREE: Final = 4.0
CONTACTS: Final = 7


class Fallback:
    """Chooses between plan and Pledge; ``pledge`` is True while Pledge drives, also as Forest-Pledge in a crowd.

    Args:
        width_m: width of the body.
        budget: contacts without progress before Pledge drives for the first time.
    """

    def __init__(self, width_m: float, budget: float) -> None:
        self._width_m, self._first_budget = width_m, budget
        self.reset()

    def reset(self) -> None:
        """Begin with the plan, at the place that ``advance`` is told of next."""
        self.pledge = False
        self._furthest_m: float | None = None
        self._budget = self._first_budget
        self._contacts = 0
        self._crowded = False
        self._planned = False  # the first budget is used up
        self._met_m: deque[float] = deque(maxlen=CONTACTS)

    @property
    def crowd(self) -> bool:
        """Whether Pledge drives only because contacts are crowded: as Forest-Pledge then."""
        return self.pledge and not self._planned

    def advance(self, ahead_m: float) -> None:
        """Note where the rover is along the goal heading."""
        if self._furthest_m is None:
            self._furthest_m = ahead_m
        elif ahead_m > self._furthest_m + PROGRESS * self._width_m:
            self._furthest_m = ahead_m
            self._budget, self._contacts, self._planned = self._first_budget, 0, False

    def meet(self, path_m: float) -> None:
        """Count a contact after this much path, and choose who drives on from it."""
        self._contacts += 1
        self._met_m.append(path_m)
        if len(self._met_m) == CONTACTS:
            per_contact = (path_m - self._met_m[0]) / (CONTACTS - 1) / self._width_m
            self._crowded = per_contact < (FREE if self._crowded else CROWDED)
        if self._contacts > self._budget:
            self._contacts = 0
            if not self._planned:
                self._planned = self.pledge = True
            else:
                self.pledge = not self.pledge
                self._budget *= 1.0 if self.pledge else 2.0
        elif not self._planned:
            self.pledge = self._crowded
