"""The tactic against driving in circles."""

from __future__ import annotations

from collections import deque

from wayfarer.escape.manoeuvres import EscapePlan
from wayfarer.escape.tactics import AnomalyContext

# An anomaly is the same as another one in a cell of 1 m and an octant of heading; three of a kind among the last 80 are
# a loop, and strict Pledge is to lead out of it for 30 (the field survey's design).
CELL_M = 1.0
OCTANT_DEG = 45.0
REMEMBERED = 80
LOOP = 3
STRICT = 30


class LoopGuard:
    """Unwind every turn, as strict Pledge does, for some anomalies after the same one was met again and again.

    A heading back at the goal ends Forest-Pledge's episodes early, which is short on average and circles in a trap
    shaped like a G. Dead reckoning that drifts by more than a cell a lap can hide a circle.
    """

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int, int]] = deque(maxlen=REMEMBERED)
        self._strict = 0

    def reset(self) -> None:
        """See ``Tactic``."""
        self._seen.clear()
        self._strict = 0

    def plan(self, context: AnomalyContext, escape_plan: EscapePlan) -> None:
        """See ``Tactic``."""
        here = (
            round(context.ahead_m / CELL_M),
            round(context.right_m / CELL_M),
            round(context.bearing_deg / OCTANT_DEG) % 8,
        )
        self._seen.append(here)
        if self._seen.count(here) >= LOOP:
            self._strict = STRICT
            self._seen.clear()
        if self._strict:
            self._strict -= 1
            escape_plan.resets = False
