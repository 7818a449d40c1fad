"""What is true of every motor board that cuts duties to its own steps."""

from __future__ import annotations

from collections.abc import Callable
from math import nan

import pytest

from wayfarer.hal import DriveMotors, WheelCommand
from wayfarer.simhal.parts import SimMotors
from wayfarer.simhal.world.world import World


async def check_applied(motors: DriveMotors, world: World, command: WheelCommand, steps: float) -> WheelCommand:
    """Drive: the wheels get what is returned, at most what was asked, and the same as at device depth."""
    applied = await motors.drive(command)
    assert world.commanded == applied
    for asked, got in zip(command, applied, strict=True):
        assert abs(asked) - 1.0 / steps < abs(got) <= abs(asked)
        assert got * asked >= 0.0
    at_device_depth = SimMotors(world, steps)
    await at_device_depth.open()
    assert await at_device_depth.drive(command) == applied
    return applied


async def check_strange_duties(motors: DriveMotors, sent: Callable[[], list[str]]) -> None:
    """Duties beyond full are full, and what is no number reaches no motor."""
    assert await motors.drive(WheelCommand(1.5, -7.0)) == await motors.drive(WheelCommand(1.0, -1.0))
    sent()
    for broken in (WheelCommand(nan, 0.5), WheelCommand(0.5, nan)):
        with pytest.raises(ValueError, match="NaN"):
            await motors.drive(broken)
    assert sent() == []
