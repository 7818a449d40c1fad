"""The controller and a motor board that fails: when the wheels are stopped, and what lets them turn again."""

from __future__ import annotations

import pytest

from tests.control.bench import TICK_S, Bench
from tests.kit.workshop import AHEAD
from wayfarer.control.modes import Mode
from wayfarer.errors import NotResponding, PowerLost
from wayfarer.hal import STOP, MotionReading
from wayfarer.safety.conditions import Condition, Level
from wayfarer.safety.power import DIPS

WARNING_TICKS = 20  # 1 s, and the light blinks
FAILED = (Level.HOLD, Condition.MOTORS_FAILED)
WARNS = (Level.HOLD, Condition.RESUME_WARNING)


async def failed(bench: Bench, ticks: int = 1) -> Bench:
    """This bench, whose motors have not acknowledged for some ticks, and do again."""
    bench.motors.error = NotResponding("bench motors: no answer")
    await bench.tick(ticks)
    bench.motors.error = None
    return bench


async def test_board_that_answers_again_turns_no_wheel_before_it_was_opened() -> None:
    bench = await failed(await Bench().armed())
    assert bench.log.named("motors_failed") == [{"error": "bench motors: no answer", "lost": None}]
    assert bench.motors.halts == 1, "a command that hangs in the wire may still get through: a stop is right behind it"
    await bench.tick(200)
    assert set(bench.motors.commands[-200:]) == {STOP}
    assert (bench.controller.mode, bench.health) == (Mode.ARMED, FAILED)
    assert len(bench.log.named("motors_failed")) == 1, "told once"
    assert len(bench.log.named("health")) <= 2


@pytest.mark.parametrize("error", [NotResponding("bench motors: no answer"), PowerLost("bench motors")])
async def test_board_that_was_opened_again_drives_after_the_warning(error: NotResponding | PowerLost) -> None:
    bench = await Bench().armed()
    bench.motors.error = error
    await bench.tick(40)
    bench.motors.error = None
    bench.controller.motors_opened(bench.t_s)
    assert bench.log.named("motors_opened") == [{}]
    await bench.tick(WARNING_TICKS)
    assert (set(bench.motors.commands[-WARNING_TICKS:]), bench.health) == ({STOP}, WARNS)
    await bench.tick(2)
    assert (bench.wheels, bench.health) == (AHEAD, (Level.WELL, None))


@pytest.mark.parametrize("losses", [DIPS - 1, DIPS])
@pytest.mark.parametrize("error", [NotResponding("bench motors: no answer"), PowerLost("bench motors")])
async def test_board_that_loses_its_power_again_and_again_is_a_supply_that_dips(
    error: NotResponding | PowerLost, losses: int
) -> None:
    """It hangs on the battery of the computer, whose own supply may have shown nothing."""
    bench = await Bench().armed()
    for _ in range(losses):
        bench.motors.error = error
        await bench.tick(5)
        bench.motors.error = None
        bench.controller.motors_opened(bench.t_s)
        await bench.tick(WARNING_TICKS + 5)
    dips = isinstance(error, PowerLost) and losses >= DIPS
    assert (Condition.POWER_UNSTABLE in bench.controller.conditions) is dips
    assert abs(bench.wheels.left) <= (0.5 if dips else 1.0)
    lost = "power" if isinstance(error, PowerLost) else None
    assert [told["lost"] for told in bench.log.named("motors_failed")] == [lost] * losses


async def test_warning_follows_also_where_the_board_was_opened_at_once() -> None:
    """Other holds that are shorter than a second need none; but nobody knows what the wheels did meanwhile."""
    bench = await failed(await Bench().armed())
    await bench.tick()
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(WARNING_TICKS)
    assert (bench.wheels, bench.health) == (STOP, WARNS)


async def test_failure_during_the_warning_holds_again() -> None:
    bench = await failed(await Bench().armed())
    await bench.tick(5)
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(WARNING_TICKS // 2)
    await failed(bench)
    await bench.tick(3 * WARNING_TICKS)
    assert (bench.wheels, bench.health) == (STOP, FAILED)
    assert len(bench.log.named("motors_failed")) == 2
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(WARNING_TICKS)
    assert (bench.wheels, bench.health) == (STOP, WARNS), "the whole warning again"


async def test_operator_who_holds_meanwhile_decides_when_it_goes_on() -> None:
    bench = await failed(await Bench().armed())
    bench.controller.hold(bench.t_s)
    await bench.tick(5)
    assert bench.health == FAILED, "the more important one of two"
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(100)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.OPERATOR_HOLD))
    bench.controller.resume(bench.t_s)
    await bench.tick(WARNING_TICKS)
    assert (bench.wheels, bench.health) == (STOP, WARNS)
    await bench.tick(2)
    assert bench.wheels == AHEAD


async def test_rover_that_was_disarmed_meanwhile_stays_so_and_its_board_failed() -> None:
    bench = await failed(await Bench().armed())
    bench.controller.disarm(bench.t_s, "a person goes there")
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(100)
    assert (bench.wheels, bench.health, bench.controller.mode) == (STOP, FAILED, Mode.DISARMED)
    assert not bench.log.named("motors_opened")
    await bench.armed()


async def test_board_that_fails_during_the_start_delay_disarms() -> None:
    bench = Bench(start_delay_s=1.0)
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    await failed(bench)
    assert not bench.controller.waits_for_motors
    await bench.tick()
    assert bench.log.named("disarmed") == [{"reason": "fault: motors_failed"}]
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(100)
    assert set(bench.motors.commands) == {STOP}


async def test_board_whose_fault_has_gone_turns_no_wheel_before_it_was_opened() -> None:
    bench = await Bench().armed()
    await bench.board_says(12.0, "motor A: drive fault", for_s=4 * TICK_S)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.MOTORS_FAILED))
    await bench.board_says(12.0, for_s=10.0)
    assert (bench.wheels, bench.health) == (STOP, FAILED)
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(WARNING_TICKS)
    assert (bench.wheels, bench.health) == (STOP, WARNS)
    await bench.tick(2)
    assert bench.wheels == AHEAD


async def test_fault_that_the_board_still_reports_holds_though_it_was_opened() -> None:
    bench = await Bench().armed()
    await bench.board_says(12.0, "motor A: drive fault", for_s=4 * TICK_S)
    bench.controller.motors_opened(bench.t_s)
    await bench.board_says(12.0, "motor A: drive fault", for_s=5.0)
    assert (bench.wheels, bench.health) == (STOP, (Level.HOLD, Condition.MOTORS_FAILED))
    assert bench.controller.waits_for_motors


async def test_fault_of_a_disarmed_rovers_board_keeps_it_from_nothing_once_it_has_gone() -> None:
    bench = Bench()
    await bench.board_says(12.0, "motor A: drive fault")
    await bench.board_says(12.0)
    assert bench.health == (Level.WELL, None)
    await bench.armed()


async def seen_at(bench: Bench, speed_m_s: float, ticks: int) -> None:
    """Let the motion sensor see the rover move ahead."""
    for n in range(ticks):
        noise_m = n % 3 * 1e-4 if speed_m_s else 0.0  # no sensor repeats a reading to the last digit
        bench.inbox.put_motion(MotionReading(bench.t_s + TICK_S, speed_m_s * TICK_S, noise_m, 1.0))
        await bench.tick()


async def test_wheels_that_turn_until_the_boards_deadman_acts_are_no_runaway() -> None:
    """It was told to stop, but the stop has not reached it."""
    bench = await Bench().armed()
    await seen_at(bench, 0.5, 10)
    bench.motors.error = NotResponding("bench motors: no answer")
    await seen_at(bench, 0.5, 18)
    assert (bench.controller.mode, bench.health) == (Mode.ARMED, FAILED)
    bench.motors.error = None
    await seen_at(bench, 0.0, 20)
    bench.controller.motors_opened(bench.t_s)
    await seen_at(bench, 0.0, WARNING_TICKS + 2)
    assert bench.wheels == AHEAD


async def test_wheels_that_no_deadman_stops_are_a_runaway_soon_after() -> None:
    bench = await Bench().armed()
    await seen_at(bench, 0.5, 10)
    bench.motors.error = NotResponding("bench motors: no answer")
    await seen_at(bench, 0.5, 23)
    assert (bench.controller.mode, bench.health) == (Mode.DISARMED, (Level.FAULT, Condition.RUNAWAY))
