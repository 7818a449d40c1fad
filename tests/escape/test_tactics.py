"""Each tactic by itself: what it makes of a plan, and what it remembers."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.escape.manoeuvres import EscapePlan
from wayfarer.escape.tactics import (
    AnomalyContext,
    LoopGuard,
    PlanScaling,
    RetryAhead,
    Tactic,
    nose_level,
    on_the_way,
)

MET = AnomalyContext(
    new_episode=True, nose_up_deg=0.0, bearing_deg=0.0, ahead_m=0.0, right_m=0.0, travelled_m=0.0, blocked_turns=0
)
RETRY = partial(RetryAhead, on_the_way)


def plan(tactic: Tactic, **met: Any) -> EscapePlan:
    """What is planned for an anomaly; before it, what the settings and the paper's choices say."""
    escape_plan = EscapePlan(turn_deg=30.0, back_off_m=0.15, straight_m=0.6, radius_m=1.15, resets=True)
    tactic.plan(MET._replace(**met), escape_plan)
    return escape_plan


def test_measures_are_multiples_of_the_rover_file_s() -> None:
    escape_plan = plan(PlanScaling(turn=2.0, straight=0.5, radius=2.0))
    assert (escape_plan.turn_deg, escape_plan.straight_m, escape_plan.radius_m) == (60.0, 0.3, 2.3)


def test_back_off_is_short_after_a_free_run_and_longer_where_that_did_not_help() -> None:
    short = RETRY()
    back_offs = [plan(short, travelled_m=at).back_off_m for at in (5.0, 5.6, 9.0)]
    assert back_offs == pytest.approx([0.1, 0.15, 0.1], abs=0.001)
    assert plan(short, travelled_m=20.0, blocked_turns=1).back_off_m == 0.15


# --- the loop guard


def lap(guard: LoopGuard, *, drift_m: float = 0.0) -> bool:
    """Whether episodes may end early after a lap of four walls, 5 m apart."""
    met = [(0.0, 5.0, 0.0), (5.0, 5.0, 90.0), (5.0, 0.0, 180.0), (0.0, 0.0, -90.0)]
    return [plan(guard, right_m=x + drift_m, ahead_m=y, bearing_deg=at).resets for x, y, at in met][-1]


def test_third_lap_of_a_circle_makes_pledge_strict_for_a_while() -> None:
    guard = LoopGuard()
    assert [lap(guard) for _ in range(3)] == [True, True, False]
    strict = [plan(guard, ahead_m=100.0 + 2.0 * k).resets for k in range(40)]
    assert strict == [False] * 26 + [True] * 14, "30 anomalies, of which the third lap had the first four"


@pytest.mark.parametrize(
    "way",
    [
        [{"ahead_m": 1.5 * k} for k in range(500)],
        [{"bearing_deg": 45.0 * k - 180.0} for k in range(8) for _ in range(2)],
        [{"ahead_m": 0.9 * k} for k in (-1, 0, 1)],
        [{"right_m": 0.9 * k} for k in (-1, 0, 1)],
    ],
    ids=["never comes back", "the same place with other headings", "next to it, ahead", "next to it, across"],
)
def test_way_that_never_repeats_itself_is_no_circle(way: list[dict[str, float]]) -> None:
    guard = LoopGuard()
    assert all(plan(guard, **met).resets for met in way)


def test_anomalies_in_a_cell_of_a_metre_and_an_octant_are_the_same() -> None:
    guard = LoopGuard()
    met = [(k * 0.45, -k * 0.45, k * 20.0) for k in (-1, 0, 1)]
    assert not [plan(guard, ahead_m=y, right_m=x, bearing_deg=at).resets for y, x, at in met][-1]


@pytest.mark.parametrize(("others", "resets"), [(38, False), (39, True)])
def test_anomaly_that_happened_three_times_among_the_last_80_is_a_circle(others: int, resets: bool) -> None:
    guard, elsewhere_m = LoopGuard(), iter(range(10, 1000, 2))
    for _ in range(2):
        plan(guard)
        for _ in range(others):
            plan(guard, ahead_m=next(elsewhere_m))
    assert plan(guard).resets is resets


def test_bearings_either_side_of_backwards_are_the_same() -> None:
    guard = LoopGuard()
    assert [plan(guard, bearing_deg=at).resets for at in (179.0, -179.0, 178.0)] == [True, True, False]


def test_circle_that_drifts_by_more_than_a_cell_a_lap_stays_hidden() -> None:
    """What the guard cannot do: its docstring says so."""
    guard = LoopGuard()
    assert all(lap(guard, drift_m=1.5 * k) for k in range(10))


# --- retrying


def test_first_anomaly_of_a_free_run_is_retried_straight_and_the_next_one_answered() -> None:
    retry = RETRY()
    turns = [plan(retry, travelled_m=at).turn_deg for at in (5.0, 5.6, 6.45, 7.4)]
    assert turns == [0.0, 30.0, 30.0, 0.0], "again within 0.9 m"


@pytest.mark.parametrize("met", [{"new_episode": False}, {"blocked_turns": 1}], ids=["along a wall", "wedged"])
def test_body_that_is_wedged_or_follows_a_wall_does_not_retry(met: dict[str, Any]) -> None:
    assert plan(RETRY(), travelled_m=5.0, **met).turn_deg == 30.0


@pytest.mark.parametrize(("nose_up_deg", "turn_deg"), [(2.9, 0.0), (-5.0, 0.0), (3.0, 30.0)])
@pytest.mark.parametrize("new_episode", [True, False])
def test_raised_nose_is_an_obstacle_at_once(nose_up_deg: float, turn_deg: float, new_episode: bool) -> None:
    retry = RetryAhead(nose_level)
    assert plan(retry, new_episode=new_episode, nose_up_deg=nose_up_deg, travelled_m=5.0).turn_deg == turn_deg


# --- all of them


@pytest.mark.parametrize("make", [LoopGuard, RETRY])
@given(st.lists(st.tuples(st.booleans(), st.floats(-180.0, 179.0), st.floats(0.0, 5.0)), max_size=40))
def test_reset_forgets_everything(make: Any, walk: list[tuple[bool, float, float]]) -> None:
    def play(tactic: Tactic) -> list[EscapePlan]:
        return [
            plan(tactic, new_episode=new, bearing_deg=at, right_m=4.0 * far, travelled_m=k * far)
            for k, (new, at, far) in enumerate(walk)
        ]

    tactic = make()
    first = play(tactic)
    tactic.reset()
    assert play(tactic) == first
