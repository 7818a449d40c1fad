"""The counter C, episodes, and the side that they keep."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.escape.walk import STUCK, Walk, make, observation
from wayfarer.escape.api import Anomaly, Phase
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.escape.handler import COUNTER_MAX_DEG


def in_episode(name: str = "pledge", heading_deg: float = 0.0, goal_heading_deg: float = 0.0) -> Walk:
    """A walk whose heading only moves as the test says, at the first anomaly of an episode."""
    walk = Walk(name, heading_deg=heading_deg, goal_heading_deg=goal_heading_deg)
    walk.turns = False
    walk.tick(*STUCK)
    return walk


@given(st.lists(st.integers(-179 * 64, 179 * 64).map(lambda n: n / 64), max_size=6))
def test_counter_is_the_sum_of_all_turns_however_they_come_about(turns_deg: list[float]) -> None:
    walk = in_episode()
    for turn_deg in turns_deg:
        # Something new each tick keeps the episode open: no probe can end it.
        walk.tick(Anomaly.NOSE_UP if walk.decision.phase is Phase.BACK_OFF else STUCK[0], turn_deg=turn_deg)
    assert walk.counter_deg == pytest.approx(sum(turns_deg), abs=1e-3)


@given(st.lists(st.integers(-179, 179), max_size=80), st.sampled_from(sorted(CATALOGUE)))
def test_counter_never_leaves_three_turns_for_longer_than_a_tick(turns_deg: list[int], name: str) -> None:
    walk = in_episode(name)
    for turn_deg in turns_deg:
        before_deg = walk.counter_deg
        decision = walk.tick(turn_deg=turn_deg)
        assert abs(walk.counter_deg) <= COUNTER_MAX_DEG
        if abs(before_deg + turn_deg) > COUNTER_MAX_DEG:
            assert (decision.phase, walk.counter_deg) == (Phase.FOLLOW, 0.0)
            assert decision.why.endswith(".overwound")


def test_blocked_turn_counts_what_was_turned() -> None:
    walk = in_episode()
    walk.to(Phase.TURN_AWAY)
    walk.tick(turn_deg=12.0)
    walk.go_on(lambda decision: decision.why == "turn_away.exhausted")
    assert walk.counter_deg == 12.0
    assert walk.handler.memory()["blocked_turns"] == 1


def test_full_turn_clears_the_count_of_blocked_turns() -> None:
    walk = in_episode()
    walk.go_on(lambda decision: decision.why == "turn_away.exhausted")
    walk.turns = True
    walk.tick(*STUCK)
    walk.go_on(lambda decision: decision.why == "turn_away.done")
    assert walk.handler.memory()["blocked_turns"] == 0


@pytest.mark.parametrize(("name", "ends"), [("pledge", False), ("forest-pledge", True)])
@pytest.mark.parametrize("off_deg", [5.0, -5.0])
def test_whole_turn_is_forgiven_within_5_degrees_by_forest_pledge_alone(name: str, ends: bool, off_deg: float) -> None:
    walk = in_episode(name)
    for _ in range(4):
        walk.tick(*STUCK, turn_deg=90.0)
    walk.to(Phase.TURN_AWAY)
    walk.tick(turn_deg=35.0)
    assert walk.tick().phase is Phase.PROBE
    walk.tick(turn_deg=off_deg - 35.0)
    assert walk.counter_deg == 360.0 + off_deg
    assert (walk.decision.why == "probe.realigned") is ends
    assert (walk.decision.phase is Phase.FOLLOW) is ends


@pytest.mark.parametrize(("name", "ends_deg", "why"), [("forest-pledge", 5.0, "realigned"), ("pledge", 0.0, "unwound")])
def test_forest_pledge_ends_at_5_degrees_and_pledge_unwinds_every_degree(name: str, ends_deg: float, why: str) -> None:
    walk = in_episode(name)
    walk.to(Phase.TURN_AWAY)
    walk.tick(turn_deg=30.0)
    walk.to(Phase.PROBE)
    assert walk.tick(turn_deg=ends_deg - 29.75).phase is Phase.PROBE
    assert walk.tick(turn_deg=-0.25).why == f"probe.{why}"


def test_episode_starts_at_the_first_anomaly_in_follow_and_ends_with_it() -> None:
    walk = Walk("pledge")
    assert walk.handler.memory()["episodes"] == 0
    walk.to(Phase.PROBE)
    walk.tick(*STUCK)
    assert walk.handler.memory()["episodes"] == 1, "an anomaly while probing belongs to the same episode"
    walk.to(Phase.FOLLOW)
    walk.tick(*STUCK)
    assert walk.handler.memory()["episodes"] == 2
    assert walk.counter_deg == 0.0


def test_rand_pledge_keeps_its_side_for_an_episode_and_draws_a_new_one_for_the_next() -> None:
    walk = Walk("rand-pledge")
    sides = []
    for _ in range(12):
        walk.to(Phase.PROBE)
        side = walk.handler.memory()["side"]
        for _ in range(3):
            walk.tick(*STUCK)
            walk.to(Phase.PROBE)
            assert walk.handler.memory()["side"] == side
        sides.append(side)
        walk.to(Phase.FOLLOW)
    assert set(sides) == {1, -1}


def test_blocked_turns_alternate_between_the_sides_from_the_third_on() -> None:
    walk = Walk("pledge")
    walk.turns = False
    sides = []
    for _ in range(6):
        walk.to(Phase.FOLLOW)
        walk.to(Phase.TURN_AWAY)
        sides.append(1 if walk.decision.wheels.left > 0.0 else -1)
    assert sides == [1, 1, -1, 1, -1, 1]


def test_angle_of_levy_pledge_stays_within_10_to_50_degrees() -> None:
    turns_deg = set()
    for seed in range(200):
        handler = make("levy-pledge", seed)
        handler.decide(observation())
        handler.decide(observation(t_s=0.05, anomalies=STUCK))
        turns_deg.add(float(handler.memory()["turn_deg"]))
    assert min(turns_deg) == 10.0
    assert max(turns_deg) == 50.0
    assert len(turns_deg) > 10


def test_blocked_turns_are_forgotten_after_a_free_run() -> None:
    walk = Walk("forest-pledge")
    for _ in range(2):
        walk.to(Phase.TURN_AWAY)
        walk.turns = False
        walk.go_on(lambda decision: decision.phase is not Phase.TURN_AWAY)
        walk.turns = True
        walk.to(Phase.FOLLOW)
    assert walk.handler.memory()["blocked_turns"] == 2
    for _ in range(40):
        walk.tick()
    walk.tick(*STUCK)
    assert (walk.handler.memory()["blocked_turns"], walk.handler.memory()["side"]) == (0, 1)
