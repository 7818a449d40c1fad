"""No manoeuvre goes on against what does not give way: fault catalogue, faults 29 and 58."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby, pairwise
from math import radians
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.escape.body import Body
from tests.escape.walk import SETTINGS, TICK_S, VEHICLE, observation
from wayfarer.angles import wrap180
from wayfarer.config.rover_file import rover_names
from wayfarer.escape.api import Anomaly, Decision, Phase
from wayfarer.escape.catalogue import BUILT_IN, CATALOGUE
from wayfarer.escape.manoeuvres import SLACK, SLACK_S
from wayfarer.hal import ContactReading, Side

GRIND_MAX_S = 3.0
STUCK = Anomaly.IMMOBILISED
ROVERS = rover_names()


def stays_s(body: Body, decisions: list[Decision]) -> list[tuple[Phase, float]]:
    """Each phase in turn, and how long it lasted."""
    return [(phase, len(list(stay)) * body.tick_s) for phase, stay in groupby(decisions, lambda each: each.phase)]


@pytest.mark.parametrize("rover", ROVERS)
@pytest.mark.parametrize("algorithm", BUILT_IN)
def test_snagged_body_changes_its_manoeuvre_every_three_seconds(rover: str, algorithm: str) -> None:
    body = Body(rover, algorithm, heading_deg=120.0)
    body.turns = body.moves = False
    stays = stays_s(body, [body.tick() for _ in range(1200)])
    assert {phase for phase, _ in stays} >= {Phase.FOLLOW, Phase.BACK_OFF, Phase.TURN_AWAY}
    assert max(stay_s for _, stay_s in stays) <= GRIND_MAX_S


@pytest.mark.parametrize("rover", ROVERS)
@pytest.mark.parametrize("slides_to_deg", [30.0, 45.0, 55.0])
def test_turn_that_is_held_when_nearly_done_runs_out_within_three_seconds(rover: str, slides_to_deg: float) -> None:
    """Feedback is at full duty by then, so that nothing is left for going ahead, and no stall shows."""
    body = Body(rover, "pledge", heading_deg=120.0)
    body.turns = body.moves = False
    for _ in range(20):
        body.tick()
    body.seen = body.seen._replace(heading_deg=slides_to_deg)
    stays = stays_s(body, [body.tick() for _ in range(1200)])
    assert stays[0][0] is Phase.FOLLOW
    assert max(stay_s for _, stay_s in stays) <= GRIND_MAX_S


@pytest.mark.parametrize("rover", ROVERS)
@pytest.mark.parametrize("held", [Phase.FOLLOW, Phase.TURN_AWAY, Phase.STRIDE])
def test_turn_that_never_turns_runs_out_within_three_seconds(rover: str, held: Phase) -> None:
    body = Body(rover, "levy-walk")  # its turns are up to a half turn: their planned time alone is longer
    if held is not Phase.FOLLOW:
        body.reach(held)
    body.turns = False
    if held is not Phase.TURN_AWAY:
        body.seen = body.seen._replace(heading_deg=(body.seen.heading_deg + 170.0) % 360.0)
    stay = body.while_in(held)
    assert body.decision.why == f"{held.value}.exhausted"
    assert len(stay) * body.tick_s <= GRIND_MAX_S


@pytest.mark.parametrize("back_off_m", [0.15, 12.0])
@pytest.mark.parametrize("travels", [True, False], ids=["commanded", "limited to nothing"])
def test_backing_off_ends_within_three_seconds_whatever_its_plan(back_off_m: float, travels: bool) -> None:
    settings = replace(SETTINGS, back_off_m=back_off_m, reverse_m_s=0.1)
    handler = CATALOGUE["pledge"].make(settings, VEHICLE, Random(1))
    handler.decide(observation())
    decisions = [
        handler.decide(observation(t_s=tick * TICK_S, anomalies=(STUCK,), travelled_m=tick * 0.005 * travels))
        for tick in range(1, 100)
    ]
    backs_off = [decision.phase is Phase.BACK_OFF for decision in decisions]
    assert 1 < backs_off.index(False) * TICK_S <= GRIND_MAX_S


@pytest.mark.parametrize("rover", ROVERS)
def test_turn_below_the_motors_dead_band_is_pushed_once_and_done(rover: str) -> None:
    body = Body(rover, "pledge", dead_band=0.2)
    body.reach(Phase.TURN_AWAY)
    stay = body.while_in(Phase.TURN_AWAY)
    assert body.decision.why == "turn_away.done"
    assert len(stay) * body.tick_s <= GRIND_MAX_S
    assert body.handler.memory()["blocked_turns"] == 0


@pytest.mark.parametrize("rover", ROVERS)
def test_pivot_to_the_goal_below_the_motors_dead_band_is_pushed(rover: str) -> None:
    body = Body(rover, "pledge", heading_deg=150.0, dead_band=0.2)
    for _ in range(round(GRIND_MAX_S / body.tick_s)):
        assert body.tick().phase is Phase.FOLLOW
    assert abs(wrap180(body.seen.heading_deg)) < 60.0


@pytest.mark.parametrize("rover", ROVERS)
def test_turn_that_gets_on_is_not_pushed(rover: str) -> None:
    """More duty is for what falls behind: a healthy turn ends slowly, so that it does not overshoot."""
    body = Body(rover, "pledge")
    body.reach(Phase.TURN_AWAY)
    duties = [abs(decision.wheels.left) for decision in body.while_in(Phase.TURN_AWAY)]
    # Feedback from a body without the lag that it expects asks for 0.01 more at the very end.
    assert all(later <= earlier + 0.011 for earlier, later in pairwise(duties))
    for _ in range(12):
        body.tick()
    assert abs(float(body.handler.memory()["counter_deg"]) - 30.0) < 1.0, "it ends where it should"
    assert duties[-1] < 0.2


seen = st.tuples(
    st.sampled_from([0.01, 0.05, 0.2, 1.0]),
    st.floats(0.0, 360.0, exclude_max=True),
    st.lists(st.sampled_from(Anomaly), max_size=3, unique=True),
    st.none() | st.lists(st.sampled_from(Side), max_size=4, unique=True),
    st.floats(0.0, 0.1),
)


@given(st.sampled_from(sorted(BUILT_IN)), st.lists(seen, max_size=150))
def test_whatever_is_seen_no_manoeuvre_but_following_outlasts_its_bound(name: str, ticks: list[Any]) -> None:
    """A stay counts from tick to tick: a manoeuvre may end in the tick that finds it out of time, and not before."""
    handler = BUILT_IN[name].make(SETTINGS, VEHICLE, Random(1))
    at, counter_deg, began_t_s = handler.decide(observation()).phase, 0.0, 0.0
    now = observation()
    for dt_s, heading_deg, anomalies, sides, travelled_m in ticks:
        now = now._replace(
            t_s=now.t_s + dt_s,
            heading_deg=heading_deg,
            anomalies=tuple(anomalies),
            contact=None if sides is None else ContactReading(now.t_s, tuple(sides), None),
            travelled_m=now.travelled_m + travelled_m,
        )
        decision = handler.decide(now)
        if decision.phase is not at or "." in decision.why:
            at, began_t_s, counter_deg = decision.phase, now.t_s, float(handler.memory()["counter_deg"])
        assert at is Phase.FOLLOW or now.t_s - began_t_s < bound_s(at, counter_deg)
        assert all(-1.0 <= duty <= 1.0 for duty in decision.wheels)


def bound_s(phase: Phase, counter_deg: float) -> float:
    arc_m = radians(abs(counter_deg)) * SETTINGS.probe_radius_m
    plan_s = {
        Phase.BACK_OFF: SETTINGS.back_off_m / SETTINGS.reverse_m_s,
        Phase.TURN_AWAY: 180.0 / SETTINGS.turn_deg_s,
        Phase.PROBE: (SETTINGS.probe_straight_m + arc_m) / SETTINGS.cruise_m_s,
        Phase.STRIDE: SETTINGS.levy_stride_max_m / SETTINGS.cruise_m_s,
    }[phase]
    return plan_s * SLACK + SLACK_S + 1e-3
