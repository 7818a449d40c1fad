"""A command that follows from an old tick stops the wheels."""

from __future__ import annotations

import asyncio

import pytest

from tests.kit.boards import stall
from tests.simhal.clearing import steady_world
from tests.virtual import virtual
from wayfarer.control.stale_command_guard import StaleCommandGuard
from wayfarer.hal import STOP, WheelCommand
from wayfarer.simhal.parts import SimMotors

AHEAD = WheelCommand(1.0, 1.0)


@pytest.mark.parametrize(("suspended_s", "applied"), [(0.0, AHEAD), (0.19, AHEAD), (0.21, STOP), (60.0, STOP)])
@virtual
async def test_command_is_applied_while_its_tick_is_young(suspended_s: float, applied: WheelCommand) -> None:
    motors = SimMotors(steady_world())
    await motors.open()
    wheels, loop = StaleCommandGuard(motors, late_s=0.2), asyncio.get_running_loop()
    await asyncio.sleep(1.0)
    wheels.tick_t_s = loop.time()
    stall(suspended_s)
    assert await wheels.drive(AHEAD) == applied
    wheels.tick_t_s = loop.time()
    assert await wheels.drive(AHEAD) == AHEAD
