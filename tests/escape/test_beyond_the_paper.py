"""The rows beyond the paper: how they differ from Forest-Pledge. Their promises are in ``tests/test_testing.py``."""

from __future__ import annotations

from math import radians
from random import Random

import pytest

from tests.escape.walk import SETTINGS, VEHICLE, Walk
from wayfarer.angles import wrap180
from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.catalogue import BEYOND_THE_PAPER


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


@pytest.mark.parametrize("name", BEYOND_THE_PAPER)
def test_wall_is_answered_at_its_second_contact(name: str) -> None:
    walk = Walk(name)
    walk.to(Phase.BACK_OFF)
    walk.to(Phase.FOLLOW)
    walk.tick(Anomaly.IMMOBILISED)
    walk.to(Phase.PROBE)
    assert wrap180(walk.seen.heading_deg) > 25.0


@pytest.mark.parametrize(
    ("name", "turn_deg", "straight_m", "radius_m"),
    [
        ("forest-pledge", 30.0, 0.6, 1.15),
        ("tight-pledge", 30.0, 0.3, 0.7),
        ("retrying-pledge", 40.0, 0.3, 1.35),
        ("nose-pledge", 40.0, 0.3, 1.35),
    ],
)
def test_wall_is_probed_with_the_turn_and_the_curve_of_the_row(
    name: str, turn_deg: float, straight_m: float, radius_m: float
) -> None:
    walk = Walk(name)
    walk.to(Phase.BACK_OFF)
    walk.to(Phase.FOLLOW)
    walk.tick(Anomaly.IMMOBILISED)
    walk.to(Phase.PROBE)
    assert wrap180(walk.seen.heading_deg) == pytest.approx(turn_deg, abs=SETTINGS.turn_within_deg)
    begun_m, curve = walk.seen.travelled_m, []
    while walk.decision.phase is Phase.PROBE:
        curved_rad = radians(turn_deg - wrap180(walk.seen.heading_deg))
        if curved_rad > 0.1:
            curve.append((walk.seen.travelled_m - begun_m, curved_rad))
        walk.tick()
    (first_m, first_rad), *_, (last_m, last_rad) = curve
    assert (last_m - first_m) / (last_rad - first_rad) == pytest.approx(radius_m, rel=0.2)
    assert 0.0 < first_m - first_rad * radius_m - straight_m < 0.15  # a tick is 0.05 m


def test_nose_that_rose_is_a_wall_at_its_first_contact() -> None:
    walk = Walk("nose-pledge")
    while walk.seen.travelled_m < 5.0:
        walk.tick()
    for pitch_deg in (2.0, 4.0, 6.0, 8.0):
        walk.seen = walk.seen._replace(pitch_deg=pitch_deg)
        walk.tick()
    walk.tick(Anomaly.IMMOBILISED)
    walk.to(Phase.PROBE)
    assert wrap180(walk.seen.heading_deg) > 25.0
