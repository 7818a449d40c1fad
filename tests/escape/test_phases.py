"""Every phase x every event and anomaly x every algorithm: what comes next, and that nothing lasts for ever."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from math import degrees, isfinite, radians

import pytest

from tests.escape.walk import SETTINGS, STUCK, TICK_S, Walk, touch
from wayfarer.escape.api import Anomaly, Decision, Phase
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.escape.manoeuvres import SLACK, SLACK_S
from wayfarer.escape.phases import PLEDGE, STRIDES, WHY, PhaseEvent
from wayfarer.hal import Side

PLEDGE_FAMILY = [name for name, row in CATALOGUE.items() if row.family == "pledge"]
FIXED_WHYS = {*WHY.values(), *(phase.value for phase in Phase)}


def travels_on(name: str) -> Phase:
    return Phase.PROBE if name in PLEDGE_FAMILY else Phase.STRIDE


def assert_sound(decision: Decision) -> None:
    assert all(isfinite(duty) and -1.0 <= duty <= 1.0 for duty in decision.wheels)
    assert decision.why in FIXED_WHYS


@pytest.mark.parametrize("name", CATALOGUE)
@pytest.mark.parametrize("anomaly", Anomaly)
def test_anomaly_backs_off_wherever_the_rover_drives_or_turns(name: str, anomaly: Anomaly) -> None:
    for phase in (Phase.FOLLOW, Phase.TURN_AWAY, travels_on(name)):
        walk = Walk(name)
        walk.to(phase)
        decision = walk.tick(anomaly)
        assert decision.phase is Phase.BACK_OFF
        assert decision.why == f"{phase.value}.anomaly"
        assert decision.wheels.left == decision.wheels.right < 0.0
        assert_sound(decision)


@pytest.mark.parametrize("name", CATALOGUE)
@pytest.mark.parametrize("anomaly", [each for each in Anomaly if each is not Anomaly.TOUCHED])
def test_new_anomaly_while_reversing_means_blocked_behind(name: str, anomaly: Anomaly) -> None:
    walk = Walk(name)
    other = Anomaly.NOSE_UP if anomaly is not Anomaly.NOSE_UP else Anomaly.IMMOBILISED
    walk.to(Phase.BACK_OFF, other)
    assert walk.tick(other).phase is Phase.BACK_OFF, "what was wrong when reversing began is not news"
    decision = walk.tick(other, anomaly)
    assert (decision.phase, decision.why) == (Phase.TURN_AWAY, "back_off.anomaly")
    assert_sound(decision)


@pytest.mark.parametrize("name", CATALOGUE)
@pytest.mark.parametrize(
    ("sides", "expected"),
    [((Side.REAR,), Phase.TURN_AWAY), ((Side.FRONT,), Phase.BACK_OFF), ((Side.LEFT,), Phase.BACK_OFF)],
)
def test_touch_while_reversing_counts_only_behind(name: str, sides: tuple[Side, ...], expected: Phase) -> None:
    walk = Walk(name)
    walk.to(Phase.BACK_OFF)
    assert walk.tick(Anomaly.TOUCHED, contact=touch(*sides)).phase is expected


@pytest.mark.parametrize("phase", [Phase.BACK_OFF, Phase.TURN_AWAY])
def test_anomaly_that_cleared_may_come_again(phase: Phase) -> None:
    walk = Walk("pledge")
    walk.to(phase)
    walk.tick(*STUCK)
    walk.to(phase)
    walk.tick()
    assert walk.tick(*STUCK).phase is not phase


@pytest.mark.parametrize("phase", [Phase.BACK_OFF, Phase.TURN_AWAY])
def test_one_of_two_anomalies_that_cleared_may_come_again(phase: Phase) -> None:
    walk = Walk("pledge")
    both = (Anomaly.IMMOBILISED, Anomaly.NOSE_UP)
    walk.tick(*both)
    while walk.decision.phase is not phase:
        walk.tick(*both)
    assert walk.tick(Anomaly.NOSE_UP).phase is phase
    assert walk.tick(*both).why == f"{phase.value}.anomaly"


def blocked_turn(walk: Walk) -> None:
    walk.to(Phase.TURN_AWAY)
    walk.turns = False


def spinning(phase: Phase) -> Callable[[Walk], None]:
    """In a phase, and the commanded distance does not grow, as under a safety hold."""

    def prepare(walk: Walk) -> None:
        walk.to(phase)
        walk.travels = False

    return prepare


def met_something(phase: Phase) -> Callable[[Walk], None]:
    def prepare(walk: Walk) -> None:
        walk.to(phase)
        walk.tick(Anomaly.NOSE_DOWN)

    return prepare


def held_tail(walk: Walk) -> None:
    walk.turns = False
    walk.seen = walk.seen._replace(heading_deg=120.0)


def overwinding(phase: Phase) -> Callable[[Walk], None]:
    """In a phase, while something turns the body round and round, away from where a turn ends."""

    def prepare(walk: Walk) -> None:
        walk.to(phase)
        walk.turns = walk.travels = False
        away = -179.0 if phase is Phase.TURN_AWAY else 179.0
        turn_deg = away * float(walk.handler.memory()["side"])
        while walk.decision.phase is phase and "." not in walk.tick(turn_deg=turn_deg).why:
            pass

    return prepare


def free(phase: Phase) -> Callable[[Walk], None]:
    def prepare(walk: Walk) -> None:
        walk.to(phase)

    return prepare


# How to bring about each event of the transition table.
ROUTES: Mapping[tuple[Phase, PhaseEvent], Callable[[Walk], None]] = {
    (Phase.FOLLOW, PhaseEvent.ANOMALY): met_something(Phase.FOLLOW),
    (Phase.FOLLOW, PhaseEvent.EXHAUSTED): held_tail,
    (Phase.BACK_OFF, PhaseEvent.DONE): free(Phase.BACK_OFF),
    (Phase.BACK_OFF, PhaseEvent.ANOMALY): met_something(Phase.BACK_OFF),
    (Phase.BACK_OFF, PhaseEvent.EXHAUSTED): spinning(Phase.BACK_OFF),
    (Phase.TURN_AWAY, PhaseEvent.DONE): free(Phase.TURN_AWAY),
    (Phase.TURN_AWAY, PhaseEvent.ANOMALY): met_something(Phase.TURN_AWAY),
    (Phase.TURN_AWAY, PhaseEvent.EXHAUSTED): blocked_turn,
    (Phase.PROBE, PhaseEvent.ANOMALY): met_something(Phase.PROBE),
    (Phase.PROBE, PhaseEvent.UNWOUND): free(Phase.PROBE),
    (Phase.PROBE, PhaseEvent.REALIGNED): free(Phase.PROBE),
    (Phase.PROBE, PhaseEvent.EXHAUSTED): spinning(Phase.PROBE),
    (Phase.STRIDE, PhaseEvent.ANOMALY): met_something(Phase.STRIDE),
    (Phase.STRIDE, PhaseEvent.DONE): free(Phase.STRIDE),
    (Phase.STRIDE, PhaseEvent.EXHAUSTED): spinning(Phase.STRIDE),
    **{(phase, PhaseEvent.OVERWOUND): overwinding(phase) for phase in Phase if phase not in {Phase.HALT, Phase.MANUAL}},
}


def test_every_row_of_the_table_has_a_route() -> None:
    assert set(ROUTES) == {*PLEDGE, *STRIDES}


def routes() -> Iterable[tuple[str, Phase, PhaseEvent]]:
    for name in CATALOGUE:
        never = (
            PhaseEvent.REALIGNED if name == "pledge" else PhaseEvent.UNWOUND
        )  # Forest-Pledge realigns before it unwinds
        for phase, event in PLEDGE if name in PLEDGE_FAMILY else STRIDES:
            if event is not never:
                yield name, phase, event


@pytest.mark.parametrize(("name", "phase", "event"), list(routes()))
def test_each_row_of_the_table_is_taken(name: str, phase: Phase, event: PhaseEvent) -> None:
    walk = Walk(name)
    ROUTES[phase, event](walk)
    decision = walk.go_on(lambda decision: decision.why == WHY[phase, event])
    assert decision.phase is (PLEDGE if name in PLEDGE_FAMILY else STRIDES)[phase, event]
    assert_sound(decision)


def test_forest_pledge_unwinds_too_when_the_goal_lies_elsewhere() -> None:
    """An episode that began askew comes back to its own beginning, outside the 5 degrees around the goal."""
    walk = Walk("forest-pledge", heading_deg=20.0)
    walk.tick(*STUCK)
    assert walk.go_on(lambda decision: decision.phase is Phase.PROBE)
    assert walk.go_on(lambda decision: decision.phase is Phase.FOLLOW).why == "probe.unwound"


@pytest.mark.parametrize("name", CATALOGUE)
def test_following_that_never_comes_round_to_the_goal_runs_out(name: str) -> None:
    """Something rocks the body to and fro: it turns, so that no stall shows, and does not get on."""
    walk = Walk(name, heading_deg=120.0)
    walk.turns = False
    ticks = 0
    while walk.decision.phase is Phase.FOLLOW:
        ticks += 1
        walk.tick(turn_deg=8.0 if ticks % 2 else -8.0)
        assert ticks * TICK_S <= 180.0 / SETTINGS.turn_deg_s * SLACK + SLACK_S + TICK_S
    assert walk.decision.why == "follow.exhausted"


@pytest.mark.parametrize("radius_m", [0.6, 1.15, 2.5])
def test_probe_curves_back_in_an_arc_of_the_radius_that_is_set(radius_m: float) -> None:
    walk = Walk("pledge", settings=replace(SETTINGS, probe_radius_m=radius_m, turn_angle_deg=90.0))
    walk.to(Phase.PROBE)
    walk.go_on(lambda _: walk.counter_deg < 60.0)  # the straight is over, and the curve is steady
    from_deg, from_m = walk.counter_deg, walk.seen.travelled_m
    while walk.counter_deg > 15.0:
        walk.tick()
        off_deg = from_deg - walk.counter_deg - degrees((walk.seen.travelled_m - from_m) / radius_m)
        assert abs(off_deg) < 3.0, "a heading for each place of the arc"
    arc_m = walk.seen.travelled_m - from_m
    assert radians(from_deg - walk.counter_deg) == pytest.approx(arc_m / radius_m, rel=0.07)


def test_curve_that_something_holds_is_an_anomaly_and_keeps_the_counter() -> None:
    walk = Walk("pledge", settings=replace(SETTINGS, turn_angle_deg=90.0))
    walk.to(Phase.PROBE)
    walk.turns = False
    assert walk.go_on(lambda decision: decision.phase is not Phase.PROBE).why == "probe.anomaly"
    assert walk.counter_deg > 80.0


@pytest.mark.parametrize("name", CATALOGUE)
def test_follow_goes_on_while_nothing_is_wrong(name: str) -> None:
    walk = Walk(name, goal_heading_deg=170.0)
    assert {walk.tick().phase for _ in range(1200)} == {Phase.FOLLOW}
    assert abs(walk.seen.heading_deg - 170.0) < 0.1
