"""The control tick: limits of a mission, what was driven, late ticks, lost sensors, and the wheels it commands."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from tests.control.bench import TICK_S, Bench
from tests.kit.motors import Motors
from tests.kit.workshop import AHEAD
from wayfarer.control.modes import Mode
from wayfarer.control.status_light import YELLOW, colour
from wayfarer.errors import NotResponding
from wayfarer.hal import STOP, MotionReading, WheelCommand
from wayfarer.safety.conditions import Condition, Level

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


@pytest.mark.parametrize("limit", ["mission_time_s", "mission_distance_m", "mission_radius_m"])
async def test_run_that_goes_on_is_disarmed_by_each_limit_and_can_be_armed_again(limit: str) -> None:
    safety: dict[str, Any] = {limit: 1.0}
    bench = Bench(goes_on=True, **safety)
    for _ in range(3):
        await bench.armed()
        assert bench.motors.commands[-1] != STOP
        await bench.tick(80)
        assert bench.controller.mode is Mode.DISARMED
        assert bench.controller.why_disarmed == limit.rpartition("_")[0]
        assert bench.motors.commands[-1] == STOP
    assert bench.end is None


class Obedient(Motors):
    """Motors that must not be told to turn by a rover that may not."""

    bench: Bench

    async def drive(self, command: WheelCommand) -> WheelCommand:
        assert command == STOP or self.bench.controller.may_turn
        return await super().drive(command)


@pytest.mark.parametrize("limit", ["mission_time_s", "mission_distance_m", "mission_radius_m"])
async def test_tick_that_disarms_at_a_limit_commands_no_wheel_to_turn(limit: str) -> None:
    """It is judged after the decision, and the mode says already that the rover is disarmed."""
    safety: dict[str, Any] = {limit: 1.0}
    motors = Obedient()
    bench = motors.bench = Bench(wheels=motors, goes_on=True, **safety)
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(80)
    assert bench.controller.mode is Mode.DISARMED
    assert set(motors.commands) == {STOP, AHEAD}


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
        bench.inbox.put_motion(MotionReading(bench.t_s, 0.001, 0.0, 0.9))
        await bench.tick()
    assert bench.end == "mission_distance"
    assert 0.0 < bench.handler.seen[-1].covered_m < 1.0


async def test_what_is_driven_without_sight_counts_by_half_for_the_radius() -> None:
    """The body drove, or pushed at a trunk, and nobody knows which; all of it counts for the limit on distance."""
    bench = await Bench(watches_motion=True).armed()
    await bench.tick(40)
    mission = bench.controller.mission
    assert mission is not None
    assert Condition.MOTION_STALE in bench.controller.conditions
    north_m, travelled_m = mission.north_m, mission.travelled_m
    await bench.tick(20)
    assert mission.travelled_m - travelled_m == pytest.approx(20 * 0.5 * TICK_S)
    assert mission.north_m - north_m == pytest.approx(0.5 * 20 * 0.5 * TICK_S)


async def test_fixes_count_more_than_dead_reckoning() -> None:
    """The wheels slip, the rover stands still and believes that it is far away."""
    bench = await Bench(mission_radius_m=1.0).armed()
    await bench.fixes(*[0.0] * 20)
    assert bench.handler.seen[-1].travelled_m > 4.0
    assert bench.end is None


async def test_position_is_logged_and_no_decision_sees_it() -> None:
    bench = await Bench().armed()
    before, mission = bench.handler.seen[-1], bench.controller.mission
    assert mission is not None
    before_m = mission.north_m
    await bench.fixes(0.0, 50.0)
    bench.inbox.put_fix(None)
    await bench.tick()
    assert [None if fix is None else fix.latitude_deg for fix in bench.log.fixes] == [
        52.0, pytest.approx(52.00045, abs=1e-5), None,
    ]  # fmt: skip
    after = bench.handler.seen[-1]
    moved = {key: getattr(before, key) for key in ("t_s", "travelled_m", "measured_m", "applied")}
    assert after._replace(**moved) == before
    driven_m = after.travelled_m - before.travelled_m
    assert mission.north_m - before_m == pytest.approx(driven_m), "dead reckoning, not 50 m"


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
    assert bench.log.named("motors_failed") == [{"error": "bench motors: no answer", "lost": None}]
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
