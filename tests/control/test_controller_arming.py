"""A mission begins when it is asked for, waits and ends as the operator says: arming, holds, the goal, refusals."""

from __future__ import annotations

from random import Random

import pytest

from tests.control.bench import TICK_S, Bench
from tests.kit.workshop import AHEAD, VEHICLE
from wayfarer.control.modes import Mode
from wayfarer.escape.api import Anomaly, EscapeHandler
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import STOP
from wayfarer.safety.conditions import Condition, Level

# -- arming ------------------------------------------------------------------------------------------------------


async def test_starts_disarmed_and_never_moves_before_arm() -> None:
    bench = Bench()
    await bench.tick(200)
    assert bench.controller.mode is Mode.DISARMED
    assert set(bench.motors.commands) == {STOP}
    assert bench.handler.seen == [], "nothing is decided while disarmed"


async def test_start_delay_passes_before_the_wheels_turn() -> None:
    bench = Bench(start_delay_s=5.0)
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(99)
    assert bench.controller.mode is Mode.ARMING
    assert set(bench.motors.commands) == {STOP}
    await bench.tick(2)
    assert (bench.controller.mode, bench.wheels) == (Mode.ARMED, AHEAD)


async def test_goal_heading_is_captured_at_the_end_of_the_delay() -> None:
    bench = Bench(start_delay_s=2.0)
    await bench.tick()
    bench.controller.arm(bench.t_s, None)
    await bench.tick(39, heading_deg=40.0)
    await bench.tick(10, heading_deg=75.0)
    assert bench.log.named("armed")[0]["goal_heading_deg"] == pytest.approx(75.0)
    assert bench.handler.seen[-1].goal_heading_deg == pytest.approx(75.0)


async def test_arming_is_refused_when_the_heading_does_not_settle() -> None:
    bench = Bench()
    await bench.tick()
    bench.controller.arm(bench.t_s, None)
    for tick in range(60):
        await bench.tick(heading_deg=tick * 10.0 % 360.0)
    assert bench.controller.mode is Mode.DISARMED
    assert bench.log.named("disarmed") == [{"reason": "not armed: the heading did not settle"}]
    assert set(bench.motors.commands) == {STOP}


async def test_arming_is_refused_without_a_compass_and_says_why() -> None:
    bench = Bench()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(60, compass=False)
    assert bench.log.named("disarmed") == [{"reason": "not armed: compass_stale"}]
    assert set(bench.motors.commands) == {STOP}


async def test_fault_that_lasts_into_arming_refuses_it_or_is_forgotten_never_both_armed_and_latched() -> None:
    """Armed while the compass is still lost; then it comes back within arming's patience."""
    bench = Bench(settle_s=1.0)
    await bench.tick()
    await bench.tick(120, compass=False)
    assert bench.health == (Level.FAULT, Condition.COMPASS_LOST)
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(3, compass=False)
    await bench.tick(40)
    assert (bench.controller.mode, bench.wheels) in [(Mode.ARMED, AHEAD), (Mode.DISARMED, STOP)]


async def test_mission_that_begins_on_a_hillside_begins_without_a_tilt() -> None:
    """The ground is as the body stands on it at the end of the delay, not before."""
    bench = Bench(start_delay_s=2.0)
    await bench.tick(20, pitch_deg=-24.0)
    assert bench.log.ticks[-1].anomalies == (Anomaly.NOSE_DOWN,)
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(20, pitch_deg=-24.0)
    await bench.tick(40, pitch_deg=24.0)
    assert bench.controller.mode is Mode.ARMED
    assert {seen.anomalies for seen in bench.handler.seen} == {()}


async def test_disarm_stops_at_the_next_tick_until_armed_again() -> None:
    bench = await Bench().armed()
    bench.controller.disarm(bench.t_s, "asked")
    await bench.tick(20)
    assert set(bench.motors.commands[-20:]) == {STOP}
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick()
    assert bench.wheels == AHEAD


async def test_arming_again_begins_afresh() -> None:
    """What the handler learnt before a long stop, or was in the middle of, is of another mission."""

    def forest_pledge() -> EscapeHandler:
        return CATALOGUE["forest-pledge"].make(bench_config.escape, VEHICLE, Random(1))

    bench_config = Bench().config
    first, second = Bench(forest_pledge()), Bench(forest_pledge())
    for bench in (first, second):
        await bench.tick()
        bench.controller.arm(bench.t_s, 0.0)
        await bench.tick(heading_deg=2.0)
    second.controller.disarm(second.t_s, "asked")
    await second.tick(1200)
    second.controller.arm(second.t_s, 0.0)
    await second.tick(heading_deg=2.0)
    assert second.wheels == pytest.approx(first.wheels)


# -- the operator ------------------------------------------------------------------------------------------------


async def test_hold_stops_the_wheels_at_the_next_tick_until_resumed_and_the_mission_goes_on() -> None:
    bench = await Bench().armed()
    mission = bench.controller.mission
    bench.controller.hold(bench.t_s)
    await bench.tick(200)
    assert set(bench.motors.commands[-200:]) == {STOP}
    assert bench.health == (Level.HOLD, Condition.OPERATOR_HOLD)
    assert bench.controller.mode is Mode.ARMED
    bench.controller.resume(bench.t_s)
    await bench.tick()
    assert bench.wheels == AHEAD
    assert bench.controller.mission is mission
    assert [name for name, _ in bench.log.events if name in {"armed", "hold", "resume", "disarmed"}] == [
        "armed", "hold", "resume",
    ]  # fmt: skip


async def test_handler_is_not_asked_during_a_hold_and_its_time_stands_still() -> None:
    bench = await Bench().armed()
    await bench.tick(3)
    before, asked = bench.handler.seen[-1], len(bench.handler.seen)
    for held_ticks in (1, 200):
        bench.controller.hold(bench.t_s)
        await bench.tick(held_ticks)
        bench.controller.resume(bench.t_s)
    assert len(bench.handler.seen) == asked
    await bench.tick(2)
    after = bench.handler.seen[asked:]
    assert [seen.t_s - before.t_s for seen in after] == pytest.approx([TICK_S, 2 * TICK_S])
    assert after[0].travelled_m - before.travelled_m == pytest.approx(0.5 * TICK_S), "only the tick before the hold"


async def test_mission_time_goes_on_during_a_hold() -> None:
    bench = await Bench(mission_time_s=3.0).armed()
    bench.controller.hold(bench.t_s)
    await bench.tick(61)
    assert bench.end == "mission_time"


@pytest.mark.parametrize(
    ("arming", "ended_by"),
    [(True, "request"), (False, "request"), (True, "too late"), (False, "limit"), (False, "fault")],
)
async def test_hold_ends_with_what_it_has_held(arming: bool, ended_by: str) -> None:
    bench = Bench(goes_on=True, mission_time_s=20.0)
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(0 if arming else 1)
    bench.controller.hold(bench.t_s)
    await bench.tick()
    assert bench.health == (Level.HOLD, Condition.OPERATOR_HOLD)
    if ended_by == "request":
        bench.controller.disarm(bench.t_s, "asked")
    elif ended_by == "fault":
        await bench.tick(10, pitch_deg=89.0)
    else:
        await bench.tick(450)
    await bench.tick()
    assert bench.controller.mode is Mode.DISARMED
    assert not bench.controller.held, "it seems to wait for a resume, which is refused"
    assert Condition.OPERATOR_HOLD not in bench.controller.conditions


async def test_rover_that_is_held_while_it_arms_waits_for_the_resume() -> None:
    bench = Bench()
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    bench.controller.hold(bench.t_s)
    await bench.tick(20)
    assert (bench.controller.mode, set(bench.motors.commands)) == (Mode.ARMING, {STOP})
    bench.controller.resume(bench.t_s)
    await bench.tick()
    assert (bench.controller.mode, bench.wheels) == (Mode.ARMED, AHEAD)


async def test_goal_is_changed_for_the_decisions_and_nothing_else() -> None:
    bench = await Bench().armed(goal_heading_deg=30.0)
    mission = bench.controller.mission
    assert bench.handler.seen[-1].goal_heading_deg == 30.0
    bench.controller.set_goal(bench.t_s, 275.0)
    await bench.tick()
    assert bench.handler.seen[-1].goal_heading_deg == 275.0
    assert bench.controller.mission is mission
    assert bench.wheels == AHEAD
    assert bench.log.named("goal") == [{"goal_heading_deg": 275.0}]


async def test_reason_for_being_disarmed_is_kept_for_who_asks() -> None:
    bench = Bench()
    assert bench.controller.why_disarmed == "not armed since the start"
    await bench.armed()
    bench.controller.disarm(bench.t_s, "asked by the operator")
    assert bench.controller.why_disarmed == "asked by the operator"
    assert bench.controller.mission is None


# -- the motor board ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("battery_v", "faults", "why"), [(10.9, (), "battery_low"), (12.0, ("motor A: drive fault",), "motors_failed")]
)
async def test_arming_is_refused_while_the_board_says_that_something_is_wrong(
    battery_v: float, faults: tuple[str, ...], why: str
) -> None:
    bench = Bench()
    await bench.board_says(battery_v, *faults)
    bench.controller.arm(bench.t_s, 0.0)
    await bench.board_says(battery_v, *faults, for_s=3.0)
    assert bench.controller.mode is Mode.DISARMED
    assert why in bench.log.named("disarmed")[0]["reason"]
    assert set(bench.motors.commands) == {STOP}


async def test_board_fault_latches_and_disarms_a_rover_among_people() -> None:
    bench = await Bench(on_lost_sense="hold").armed()
    await bench.board_says(12.0, "motor A: drive fault", for_s=2 * TICK_S)
    assert (bench.wheels, bench.controller.mode) == (STOP, Mode.DISARMED)
    await bench.board_says(12.0)
    assert (bench.wheels, bench.health) == (STOP, (Level.FAULT, Condition.MOTORS_FAILED)), "latched though it has gone"
    assert bench.log.named("disarmed") == [{"reason": "fault: motors_failed"}]
    await bench.armed()
    assert bench.health == (Level.WELL, None)
