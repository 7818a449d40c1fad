"""Memory-Pledge as a whole: a goal that changes, and a rover that measures nothing."""

from __future__ import annotations

from math import cos, radians
from random import Random

import pytest

from tests.escape.walk import STUCK, TICK_S, VEHICLE, Walk
from wayfarer.escape.api import ContactMap, Phase

WALL_AHEAD_M = 3.0


class Walled(Walk):
    """A rover in front of an endless wall, which is told of a stall after it has pushed for some time."""

    def __init__(self, stall_s: float) -> None:
        self.north_m = self.pushed_s = 0.0
        self.stall_s = stall_s
        super().__init__("memory-pledge")

    def drive(self) -> None:
        """Drive for a tick."""
        left, right = self.decision.wheels
        ahead = cos(radians(self.seen.heading_deg))
        north_m = self.north_m + (left + right) / 2 * VEHICLE.max_speed_m_s * TICK_S * ahead
        pushes = north_m > WALL_AHEAD_M and ahead > 0.7
        self.north_m = min(north_m, WALL_AHEAD_M)
        self.pushed_s = self.pushed_s + TICK_S if pushes else 0.0
        self.tick(*(STUCK if self.pushed_s >= self.stall_s else ()))

    def contacts(self, ticks: int) -> int:
        """How many anomalies there are in so many ticks."""
        stalls = 0
        for _ in range(ticks):
            self.drive()
            stalls += self.decision.why == "follow.anomaly"
        return stalls

    @property
    def remembered(self) -> ContactMap:
        return self.handler.contact_map()  # type: ignore[attr-defined,no-any-return]


@pytest.mark.parametrize("stall_s", [0.3, 0.5, 2.0])
def test_rover_that_measures_nothing_does_not_push_at_a_wall_for_ever(stall_s: float) -> None:
    walk = Walled(stall_s)
    assert walk.contacts(200) < 10
    assert walk.remembered.trunks


def test_goal_heading_that_is_computed_at_each_tick_keeps_the_map() -> None:
    walk, rng = Walled(0.3), Random(1)
    for _ in range(200):
        walk.seen = walk.seen._replace(goal_heading_deg=rng.uniform(-1.0, 1.0) % 360.0)
        walk.drive()
    assert walk.remembered.trunks


@pytest.mark.parametrize("ticks", range(60, 120, 6))
def test_another_goal_forgets_the_map_in_any_phase(ticks: int) -> None:
    walk = Walled(0.3)
    walk.contacts(ticks)
    walk.seen = walk.seen._replace(goal_heading_deg=180.0)
    walk.drive()
    assert (walk.remembered.trunks, walk.remembered.way) == ((), ())
    walk.contacts(200)
    assert walk.decision.phase is Phase.FOLLOW
    assert abs(walk.seen.heading_deg - 180.0) < 5.0
