"""The control tick: disarmed until told, the goal heading, limits, faults, and the wheels it commands."""

from __future__ import annotations

from math import nan
from random import Random
from typing import Any

import pytest

from tests.control.bench import TICK_S, Bench
from tests.kit.workshop import AHEAD, VEHICLE
from wayfarer.control.controller import Mode
from wayfarer.control.status_light import YELLOW, colour
from wayfarer.errors import NotResponding
from wayfarer.escape.api import Anomaly, EscapeHandler
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.hal import STOP, MotionReading, WheelCommand
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


# -- limits ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("limit", "value", "ticks_within", "text"),
    [("mission_time", 3.0, 59, "3 s"), ("mission_distance", 1.0, 38, "1 m"), ("mission_radius", 2.0, 78, "2 m")],
)
async def test_each_limit_ends_the_run_with_its_reason(limit: str, value: float, ticks_within: int, text: str) -> None:
    safety: dict[str, Any] = {f"{limit}_{text[-1]}": value}
    bench = await Bench(**safety).armed()
    await bench.tick(ticks_within, heading_deg=40.0)
    assert bench.end is None
    await bench.tick(4, heading_deg=40.0)
    assert bench.end == limit
    assert bench.controller.end is not None
    assert text in bench.controller.end.text


async def test_limits_count_from_arming_and_not_while_disarmed() -> None:
    bench = Bench(mission_time_s=1.0)
    await bench.tick(100)
    assert bench.controller.end is None
    await bench.armed()
    bench.controller.disarm(bench.t_s, "asked")
    await bench.tick(100)
    assert bench.controller.end is None


async def test_radius_lies_around_the_place_of_each_arming() -> None:
    bench = await Bench(mission_radius_m=2.0).armed()
    for _ in range(3):
        await bench.tick(60)
        assert bench.end is None
        bench.controller.disarm(bench.t_s, "asked")
        await bench.armed()
    assert bench.handler.seen[-1].travelled_m > 2.0


async def test_first_reason_to_end_stands() -> None:
    controller = Bench().controller
    controller.finish("escaped", "out")
    controller.finish("tipped", "over")
    assert controller.end is not None
    assert controller.end.reason == "escaped"


async def test_rover_that_goes_to_and_fro_does_not_reach_its_radius() -> None:
    bench = await Bench(mission_radius_m=1.0).armed()
    for leg in range(6):
        bench.handler.wheels = AHEAD if leg % 2 == 0 else WheelCommand(-0.5, -0.5)
        await bench.tick(30)
    assert bench.end is None
    assert bench.handler.seen[-1].travelled_m > 3.0


async def test_wheels_that_spin_take_the_rover_no_nearer_to_its_radius() -> None:
    """Commanded distance still counts for the limit on distance."""
    bench = await Bench(mission_radius_m=1.0, mission_distance_m=4.0).armed()
    for _ in range(400):
        if bench.end is not None:
            break
        bench.buffers.motion.write(MotionReading(bench.t_s, 0.001, 0.0, 0.9))
        await bench.tick()
    assert bench.end == "mission_distance"
    assert 0.0 < bench.handler.seen[-1].covered_m < 1.0


async def test_fixes_count_more_than_dead_reckoning() -> None:
    """The wheels slip, the rover stands still and believes that it is far away."""
    bench = await Bench(mission_radius_m=1.0).armed()
    await bench.fixes(*[0.0] * 20)
    assert bench.handler.seen[-1].travelled_m > 4.0
    assert bench.end is None


async def test_position_is_logged_and_no_decision_sees_it() -> None:
    bench = await Bench().armed()
    before = bench.handler.seen[-1]
    await bench.fixes(0.0, 50.0)
    bench.controller.position(None)
    assert [None if fix is None else fix.latitude_deg for fix in bench.log.fixes] == [
        52.0, pytest.approx(52.00045, abs=1e-5), None,
    ]  # fmt: skip
    moved = {key: getattr(before, key) for key in ("t_s", "travelled_m", "measured_m", "applied")}
    assert bench.handler.seen[-1]._replace(**moved) == before


# -- the operator ------------------------------------------------------------------------------------------------


async def test_hold_stops_the_wheels_at_the_next_tick_until_resumed_and_the_mission_goes_on() -> None:
    bench = await Bench().armed()
    mission = bench.controller.mission
    bench.controller.hold(bench.t_s, held=True)
    await bench.tick(200)
    assert set(bench.motors.commands[-200:]) == {STOP}
    assert bench.health == (Level.HOLD, Condition.OPERATOR_HOLD)
    assert bench.controller.mode is Mode.ARMED
    bench.controller.hold(bench.t_s, held=False)
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
        bench.controller.hold(bench.t_s, held=True)
        await bench.tick(held_ticks)
        bench.controller.hold(bench.t_s, held=False)
    assert len(bench.handler.seen) == asked
    await bench.tick(2)
    after = bench.handler.seen[asked:]
    assert [seen.t_s - before.t_s for seen in after] == pytest.approx([TICK_S, 2 * TICK_S])
    assert after[0].travelled_m - before.travelled_m == pytest.approx(0.5 * TICK_S), "only the tick before the hold"


async def test_mission_time_goes_on_during_a_hold() -> None:
    bench = await Bench(mission_time_s=3.0).armed()
    bench.controller.hold(bench.t_s, held=True)
    await bench.tick(61)
    assert bench.end == "mission_time"


async def test_hold_does_not_outlive_arming_again() -> None:
    bench = await Bench().armed()
    bench.controller.hold(bench.t_s, held=True)
    bench.controller.disarm(bench.t_s, "asked")
    await bench.tick()
    await bench.armed()
    assert not bench.controller.held


async def test_rover_that_is_held_while_it_arms_waits_for_the_resume() -> None:
    bench = Bench()
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    bench.controller.hold(bench.t_s, held=True)
    await bench.tick(20)
    assert (bench.controller.mode, set(bench.motors.commands)) == (Mode.ARMING, {STOP})
    bench.controller.hold(bench.t_s, held=False)
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
    ("battery_v", "faults", "why"), [(10.9, (), "battery_low"), (12.0, ("motor A: drive fault",), "board_fault")]
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
    assert (bench.wheels, bench.health) == (STOP, (Level.FAULT, Condition.BOARD_FAULT)), "latched though it has gone"
    assert bench.log.named("disarmed") == [{"reason": "fault: board_fault"}]
    await bench.armed()
    assert bench.health == (Level.WELL, None)


# -- the tick ----------------------------------------------------------------------------------------------------


async def test_travelled_distance_is_what_was_commanded_both_ways_and_not_while_pivoting() -> None:
    bench = await Bench().armed()
    travelled_m = bench.handler.seen[-1].travelled_m
    for wheels in (AHEAD, WheelCommand(-0.5, -0.5), WheelCommand(0.5, -0.5)):
        bench.handler.wheels = wheels
        await bench.tick(10)
    await bench.tick()
    assert bench.handler.seen[-1].travelled_m - travelled_m == pytest.approx(2 * 10 * 0.5 * TICK_S + 0.5 * TICK_S)


async def test_each_tick_leaves_one_record_of_what_was_really_applied() -> None:
    bench = await Bench(duty_max=0.5).armed()
    bench.handler.wheels = WheelCommand(0.9, 0.9)
    await bench.tick(5)
    assert len(bench.log.ticks) == 7
    record = bench.log.ticks[-1]
    assert record.decision.wheels == (0.9, 0.9)
    assert record.applied == (0.5, 0.5)
    assert record.observation is bench.handler.seen[-1]
    assert record.memory()["episodes"] == 0


async def test_late_tick_holds_the_wheels_for_one_tick() -> None:
    bench = await Bench(tick_late_s=0.2).armed()
    await bench.tick(dt_s=0.19)
    assert bench.wheels == AHEAD
    await bench.tick(dt_s=0.25)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.TICK_LATE))
    await bench.tick()
    assert (bench.wheels, bench.health) == (AHEAD, (Level.WELL, None))


async def test_time_in_which_no_tick_came_is_neither_driven_nor_tried() -> None:
    """A computer that was suspended for a minute was not stuck for a minute, and went no sixty metres."""
    bench = await Bench(tick_late_s=0.2, resume_warning_s=0.0).armed()
    await bench.tick()
    travelled_m = bench.handler.seen[-1].travelled_m
    await bench.tick(dt_s=60.0)
    await bench.tick()
    assert bench.controller.mode is Mode.ARMED
    assert bench.handler.seen[-1].travelled_m - travelled_m == pytest.approx(0.5 * 1.0 * 0.2)


@pytest.mark.parametrize(("suspended_s", "applied"), [(0.0, AHEAD), (0.19, AHEAD), (0.21, STOP), (60.0, STOP)])
async def test_command_of_a_tick_that_began_long_ago_is_a_stop(suspended_s: float, applied: WheelCommand) -> None:
    bench = await Bench(tick_late_s=0.2).armed()
    bench.suspended_s = suspended_s
    await bench.tick()
    assert bench.wheels == bench.log.ticks[-1].applied == applied
    bench.suspended_s = 0.0
    await bench.tick()
    assert bench.wheels == AHEAD


@pytest.mark.parametrize("gap_s", [0.3, 1.5, 3.0, 20.0, 60.0])
async def test_wheels_stand_still_and_the_light_warns_before_they_turn_again_after_a_long_gap(gap_s: float) -> None:
    bench = await Bench(resume_warning_s=1.0).armed()
    await bench.tick(dt_s=gap_s)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.TICK_LATE))
    standing = []
    for _ in range(round(2.0 / TICK_S)):
        await bench.tick()
        standing.append(bench.wheels == STOP)
        warned = (bench.health, colour(bench.controller, 0.0)) == ((Level.HOLD, Condition.RESUME_WARNING), YELLOW)
        assert warned is standing[-1]
    assert sum(standing) * TICK_S == pytest.approx(1.0 if gap_s > 1.0 else 0.0, abs=1.5 * TICK_S)
    assert (bench.controller.mode, bench.wheels) == (Mode.ARMED, AHEAD)


async def test_stale_compass_holds_the_wheels_and_they_resume() -> None:
    bench = await Bench().armed()
    await bench.tick(18, compass=False)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.COMPASS_STALE))
    assert bench.controller.mode is Mode.ARMED
    assert [details["cause"] for details in bench.log.named("health")] == ["compass_stale"], "told when it changes"
    await bench.tick()
    assert bench.wheels == AHEAD
    assert [details["level"] for details in bench.log.named("health")][-2:] == ["hold", "well"]


async def test_hold_of_the_mission_before_is_not_warned_of_in_the_next() -> None:
    bench = await Bench().armed()
    await bench.tick(40, compass=False)
    bench.controller.disarm(bench.t_s, "by a person")
    await bench.tick(4)
    await bench.armed()
    await bench.tick()
    assert bench.wheels == AHEAD


async def test_rover_without_a_compass_stands_for_three_seconds_warns_and_goes_on_until_it_is_back() -> None:
    bench = await Bench().armed()
    await bench.tick(300, compass=False)
    causes = [each["cause"] for each in bench.log.named("health")]
    assert causes[-3:] == ["compass_stale", "resume_warning", "heading_reckoned"]
    stood = [tick for tick in bench.log.ticks if tick.applied == STOP and tick.cause is not None]
    assert stood[-1].t_s - stood[0].t_s == pytest.approx(3.0 + 1.0, abs=0.1)  # and the warning
    assert bench.wheels == AHEAD
    await bench.tick(25)
    assert bench.controller.conditions == ()
    assert bench.wheels == AHEAD


async def test_lost_compass_is_a_fault_that_disarms_a_rover_among_people() -> None:
    bench = await Bench(on_lost_sense="hold").armed()
    await bench.tick(120, compass=False)
    assert bench.controller.mode is Mode.DISARMED
    assert bench.log.named("disarmed") == [{"reason": "fault: compass_lost"}]
    await bench.tick(50)
    assert bench.wheels == STOP
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick()
    assert bench.wheels == AHEAD


async def test_motors_that_do_not_answer_latch_a_fault_and_disarm_a_rover_among_people() -> None:
    bench = await Bench(on_lost_sense="hold").armed()
    bench.motors.error = NotResponding("bench motors: no answer")
    await bench.tick()
    assert bench.log.ticks[-1].applied == STOP
    assert bench.log.named("motors_failed") == [{"error": "bench motors: no answer"}]
    assert bench.motors.halts == 1, "a command that hangs in the wire may still get through: a stop is right behind it"
    await bench.tick(40)
    assert len(bench.log.named("motors_failed")) == len(bench.log.named("disarmed")) == 1, "told once"
    assert len(bench.log.named("health")) <= 2
    bench.motors.error = None
    await bench.tick(20)
    assert set(bench.motors.commands[-20:]) == {STOP}
    assert (bench.controller.mode, bench.health) == (Mode.DISARMED, (Level.FAULT, Condition.MOTORS_FAILED))
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick()
    assert bench.wheels == AHEAD


async def test_decision_that_is_no_number_stops_latches_and_disarms() -> None:
    bench = await Bench().armed()
    bench.handler.wheels = WheelCommand(nan, 0.5)
    await bench.tick()
    assert bench.wheels == STOP
    assert (bench.controller.mode, bench.health) == (Mode.DISARMED, (Level.FAULT, Condition.DECISION_INVALID))
