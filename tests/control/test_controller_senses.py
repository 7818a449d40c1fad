"""What the detector finds, at the controller: a runaway is fought, and what cannot be reaches no decision."""

from __future__ import annotations

from math import inf, nan

import pytest

from tests.control.bench import TICK_S, Bench
from wayfarer.control.modes import Mode
from wayfarer.hal import STOP, ContactReading, MotionReading, Side, WheelCommand
from wayfarer.safety.conditions import Condition, Level


class Rolling(Bench):
    """A rover of which the ground goes by, whatever it is told."""

    async def roll(self, ticks: int, speed_m_s: float = 0.5) -> None:
        for n in range(ticks):
            noise_m = n % 3 * 1e-4 if speed_m_s else 0.0  # no sensor repeats a reading to the last digit
            self.inbox.put_motion(MotionReading(self.t_s + TICK_S, speed_m_s * TICK_S, noise_m, 1.0))
            await self.tick()


async def test_rover_that_goes_on_while_held_is_a_fault_within_half_a_second_and_stopped_at_each_tick() -> None:
    bench = Rolling()
    await bench.armed()
    await bench.roll(10)
    bench.controller.hold(bench.t_s)
    await bench.roll(11)  # the first of them sends the stop
    assert bench.health == (Level.FAULT, Condition.RUNAWAY)
    assert bench.log.named("disarmed") == [{"reason": "fault: runaway"}]
    assert bench.motors.halts == 1
    await bench.roll(20)
    assert bench.motors.halts == 21, "it goes on being stopped though it is disarmed now"
    await bench.roll(20, speed_m_s=0.0)
    assert bench.motors.halts == 21
    assert set(bench.motors.commands[-40:]) == {STOP}


async def test_rover_that_ran_away_is_not_armed_while_it_still_rolls() -> None:
    bench = Rolling()
    await bench.armed()
    bench.controller.hold(bench.t_s)
    await bench.roll(20)
    modes = [bench.controller.mode]
    bench.controller.arm(bench.t_s, 0.0)
    for speed_m_s in (0.5, 0.0):
        await bench.roll(5, speed_m_s)
        modes.append(bench.controller.mode)
    assert modes == [Mode.DISARMED, Mode.ARMING, Mode.ARMED]


async def test_person_may_push_a_rover_that_is_not_armed() -> None:
    bench = Rolling()
    await bench.roll(40)
    assert bench.health == (Level.WELL, None)
    assert bench.controller.conditions == ()
    assert bench.motors.halts == 0


async def test_contact_that_cannot_be_reaches_no_decision() -> None:
    bench = await Bench().armed()
    good = ContactReading(bench.t_s, (Side.LEFT,), 30.0)
    bench.inbox.put_contact(good)
    await bench.tick()
    assert bench.handler.seen[-1].contact == good
    for bearing_deg in (nan, inf, -1.0, 180.0):
        bench.inbox.put_contact(ContactReading(bench.t_s, (Side.RIGHT,), bearing_deg))
        await bench.tick()
        assert bench.handler.seen[-1].contact == good
    bench.inbox.put_contact(ContactReading(bench.t_s + 60.0, (Side.RIGHT,), None))
    await bench.tick()
    assert bench.handler.seen[-1].contact == good


@pytest.mark.parametrize("applied", [WheelCommand(nan, 0.5), WheelCommand(0.5, inf), WheelCommand(2.0, 0.0)])
async def test_motors_that_say_what_cannot_be_are_lost_and_no_limit_is_lifted(
    applied: WheelCommand, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Distance travelled would be no number for ever after, and never reach the mission's limit."""
    bench = await Bench().armed()

    async def drive(_command: WheelCommand) -> WheelCommand:
        return applied

    with monkeypatch.context() as patched:
        patched.setattr(bench.motors, "drive", drive)
        await bench.tick(2)
    assert bench.health == (Level.HOLD, Condition.MOTORS_FAILED)
    assert bench.log.ticks[-1].applied == STOP
    assert "duties" in bench.log.named("motors_failed")[0]["error"]
    bench.controller.disarm(bench.t_s, "somebody looks at it")
    await bench.armed()
    await bench.tick(5)
    assert bench.handler.seen[-1].travelled_m < 1.0
