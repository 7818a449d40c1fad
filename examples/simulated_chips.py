"""A rover file tried before there is a rover: `wayfarer check` and `wayfarer run` over simulated chips, in real time.

The first line of the file my-rover.toml: buses = "simulated_chips:buses"
Run it: pip install '.[sim]' && PYTHONPATH=examples wayfarer check --rover my-rover.toml
"""

import time
from pathlib import Path

from wayfarer.config.rover_file import load_rover
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chip_wiring import ChipWiring
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.world import World

ROVER = "./my-rover.toml" if Path("my-rover.toml").exists() else "forestrover"


def buses() -> FakeBuses:
    """Return buses with a chip for each part of my-rover.toml, of a rover that stands in a forest."""
    rover, chips, streams = load_rover(ROVER), FakeBuses(), RandomStreams(0)
    world = World(generate_forest(7, noise=0, seed=0), rover.vehicle, Physics(), streams, starts_s=time.monotonic())
    wiring = ChipWiring(world, streams, time.monotonic, chips)
    world.tick_chips = wiring.tick
    for part, table in rover.parts.items():
        wiring.attach(part, table)
    return chips


if __name__ == "__main__":
    print(type(buses().i2c("/dev/i2c-1").chip_at(0x60)).__name__)
