"""A command that follows from an old tick stops the wheels."""

from __future__ import annotations

import asyncio

import pytest

from tests.virtual import virtual
from wayfarer.control.fresh_wheels import FreshWheels
from wayfarer.escape.api import Vehicle
from wayfarer.hal import STOP, WheelCommand
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.parts import SimMotors
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

AHEAD = WheelCommand(1.0, 1.0)
CLEARING = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ())


@pytest.mark.parametrize(("suspended_s", "applied"), [(0.0, AHEAD), (0.19, AHEAD), (0.21, STOP), (60.0, STOP)])
@virtual
async def test_command_is_applied_while_its_tick_is_young(suspended_s: float, applied: WheelCommand) -> None:
    motors = SimMotors(World(CLEARING, Vehicle(0.4, 0.4, 0.5, 1.0), Physics(), RandomStreams(0)))
    await motors.open()
    wheels, loop = FreshWheels(motors, late_s=0.2), asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    await asyncio.sleep(1.0)
    wheels.tick_t_s = loop.time()
    loop.stall(suspended_s)
    assert await wheels.drive(AHEAD) == applied
    wheels.tick_t_s = loop.time()
    assert await wheels.drive(AHEAD) == AHEAD
