"""The rows beyond the paper: how they differ from Forest-Pledge. Their promises are in ``tests/test_testing.py``."""

from __future__ import annotations

from random import Random

import pytest

from tests.escape.walk import SETTINGS, VEHICLE, Walk
from wayfarer.angles import wrap180
from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.catalogue import BEYOND_THE_PAPER
from wayfarer.escape.memory.fallback import CONTACTS


@pytest.mark.parametrize("name", BEYOND_THE_PAPER)
def test_row_draws_no_chance(name: str) -> None:
    rng = Random(1)
    before = rng.getstate()
    handler = BEYOND_THE_PAPER[name].make(SETTINGS, VEHICLE, rng)
    walk = Walk(name)
    walk.handler = handler
    for _ in range(3):
        walk.to(Phase.BACK_OFF)
        walk.to(Phase.FOLLOW)
    assert rng.getstate() == before


def widest_turn_deg(name: str, *anomalies: Anomaly) -> float:
    """How far from the goal the rover heads between an anomaly, after 5 m of free driving, and following it again."""
    walk = Walk(name)
    while walk.seen.travelled_m < 5.0:
        walk.tick()
    walk.tick(*anomalies)
    widest = 0.0
    while walk.decision.phase is not Phase.FOLLOW:
        walk.tick()
        widest = max(widest, abs(wrap180(walk.seen.heading_deg)))
    return widest


def test_slip_is_answered_straight_ahead_by_the_rows_beyond_the_paper() -> None:
    for name in BEYOND_THE_PAPER:
        assert widest_turn_deg(name, Anomaly.IMMOBILISED) < 5.0
    assert widest_turn_deg("forest-pledge", Anomaly.IMMOBILISED) > 25.0


def meet_wall(walk: Walk) -> None:
    """Meet a wall and, after the second try, turn away from it."""
    walk.to(Phase.BACK_OFF)
    walk.to(Phase.FOLLOW)
    again_m = walk.seen.travelled_m + 0.35  # back to the wall, and the wheels spin there until the stall is noticed
    while walk.seen.travelled_m < again_m:
        walk.tick()
    walk.tick(Anomaly.IMMOBILISED)
    walk.to(Phase.TURN_AWAY)
    walk.to(Phase.FOLLOW)


@pytest.mark.parametrize("name", BEYOND_THE_PAPER)
def test_wall_is_answered_at_its_second_contact(name: str) -> None:
    walk = Walk(name)
    meet_wall(walk)
    assert abs(wrap180(walk.seen.heading_deg)) > 25.0


def test_nose_that_rose_is_a_wall_at_its_first_contact() -> None:
    walk = Walk("memory-pledge")
    while walk.seen.travelled_m < 5.0:
        walk.tick()
    for pitch_deg in (2.0, 4.0, 6.0, 8.0):
        walk.seen = walk.seen._replace(pitch_deg=pitch_deg)
        walk.tick()
    walk.tick(Anomaly.IMMOBILISED)
    walk.to(Phase.TURN_AWAY)
    walk.to(Phase.FOLLOW)
    assert abs(wrap180(walk.seen.heading_deg)) > 25.0


def test_in_a_crowd_it_drives_as_forest_pledge() -> None:
    """Its angle, no second try, and an episode ends with the heading back at the goal: Pledge alone unwinds all."""
    walk = Walk("memory-pledge")
    for _ in range(3 * CONTACTS):  # with second tries in between, until all of them have met something
        again_m = walk.seen.travelled_m + 0.25
        walk.go_on(lambda decision: decision.phase in (Phase.FOLLOW, Phase.PROBE))
        while walk.seen.travelled_m < again_m:
            walk.tick()
        walk.tick(Anomaly.IMMOBILISED)
    assert walk.handler.memory()["turn_deg"] == SETTINGS.turn_angle_deg
    walk.to(Phase.FOLLOW)
    walk.go_on(lambda _decision: abs(wrap180(walk.seen.heading_deg)) < 3.0)
    walk.to(Phase.BACK_OFF)
    walk.to(Phase.FOLLOW)
    assert walk.decision.why == "probe.realigned"


def test_turn_at_a_waypoint_is_not_taken_for_one_that_is_held() -> None:
    """However long the rover has followed its way: a turn that is held is looked for every 4 s."""
    for stands_ticks in range(62, 72, 2):
        walk = Walk("memory-pledge")
        meet_wall(walk)
        for tick in range(stands_ticks + 30):
            walk.travels = tick >= stands_ticks
            assert walk.tick().phase is Phase.FOLLOW
