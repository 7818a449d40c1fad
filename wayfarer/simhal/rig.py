"""Putting a simulated rover together: the parts that field code gets, over one world."""

from __future__ import annotations

from wayfarer.hal import Rover
from wayfarer.simhal.devices import SimBumper, SimCompass, SimFlow, SimMotors
from wayfarer.simhal.streams import Streams
from wayfarer.simhal.world import World


def device_depth(world: World, streams: Streams) -> Rover:
    """Return a rover whose parts implement the driver protocols directly."""
    return Rover(
        compass=SimCompass(world, streams),
        motors=SimMotors(world),
        motion=SimFlow(world, streams),
        contact=SimBumper(world),
    )
