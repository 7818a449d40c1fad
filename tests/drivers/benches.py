"""What drivers need to run on simulated chips: a clock, and a world whose wheels turn as told."""

from __future__ import annotations

import asyncio

from wayfarer.escape.api import Vehicle
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

CLEARING = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ())
VEHICLE = Vehicle(0.4, 0.4, 0.5, 1.4)
STEADY = Physics(steer_noise_rad=0.0, heading_noise_deg=0.0, side_gain_sd=0.0, track_sd=0.0, slip_mean_m=1e9)


def now_s() -> float:
    """The time on the loop, and zero before it runs: a fixture makes its chips before that."""
    try:
        return asyncio.get_running_loop().time()
    except RuntimeError:
        return 0.0


def stall(for_s: float) -> None:
    """Let time pass without the loop, as in a process that is suspended."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    loop.stall(for_s)


def steady_world() -> World:
    """Return a clearing in which nothing is left to chance."""
    return World(CLEARING, VEHICLE, STEADY, RandomStreams(0))
