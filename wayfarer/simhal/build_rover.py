"""Builds a simulated rover over one world, at device depth or at bus depth.

*Device depth*: simulated parts implement the driver protocols directly; fast. *Bus depth*: the real drivers, over fake
buses that hold register-accurate chips. Both feel the same sensors, in the same quanta, and so decide the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

from wayfarer.config.factory import assemble
from wayfarer.config.registry import BUILT_IN_DRIVERS
from wayfarer.config.rover_file import RoverConfig, part_settings
from wayfarer.config.settings import WHEEL_KEYS
from wayfarer.errors import BadConfig
from wayfarer.hal import Rover
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.chip_wiring import ChipWiring, chip_of
from wayfarer.simhal.parts import SimBumper, SimCompass, SimFlow, SimMotors, SimReceiver, SimWheels
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.physics import Depth
from wayfarer.simhal.world.simulated_world import SimulatedWorld
from wayfarer.simhal.world.wheeled_body import body_of

Clock = Callable[[], float]


def build(
    depth: Depth,
    world: SimulatedWorld,
    streams: RandomStreams,
    config: RoverConfig,
    clock: Clock,
    buses: FakeBuses | None = None,
) -> Rover:
    """Return a simulated rover; at bus depth on these buses, or else on new ones.

    Raises:
        BadConfig: at bus depth, a part has no simulated chip.
    """
    world.stall_current_a = config.detector.stall_current_a or world.stall_current_a
    asks = "wheels" in config.parts or not config.sources.isdisjoint({"wheels", "current"})
    if asks and not config.chassis.missing(WHEEL_KEYS):
        world.wheeled = body_of(config.name, config.vehicle, config.chassis, "its wheel sensor")
    if depth is Depth.BUS:
        return bus_depth(world, streams, config, clock, buses or FakeBuses())
    return device_depth(world, streams, config)


def device_depth(world: SimulatedWorld, streams: RandomStreams, config: RoverConfig) -> Rover:
    """Return a rover whose parts implement the driver protocols directly; parts in the file give their quanta."""
    return Rover(
        compass=SimCompass(world, streams, **_quanta("compass", config)),
        motors=SimMotors(world, **_quanta("motors", config)),
        motion=SimFlow(world, streams, **_quanta("motion", config)),
        contact=SimBumper(world) if _has_bumper(config) else None,
        wheels=_wheels(world, config),
        position=_receiver(world, streams, config),
    )


def _quanta(part: str, config: RoverConfig) -> Mapping[str, Any]:
    """Return the quanta of a part's chip, none if the file has no such part or its driver no chip."""
    if part not in config.parts:
        return {}
    chip, settings = chip_of(part, config.parts[part])
    return chip.quanta(settings) if chip else {}


def bus_depth(
    world: SimulatedWorld, streams: RandomStreams, config: RoverConfig, clock: Clock, buses: FakeBuses
) -> Rover:
    """Return the rover of the file with its real drivers, each over a simulated chip.

    A bumper or receiver without a chip, as wayfarer's own, is simulated as at device depth: the bumper also feels the
    obstacle's bearing. A light without a chip is left out.
    """
    wiring = ChipWiring(world, streams, clock, buses)
    world.tick_chips = wiring.tick
    on_a_bus = _on_a_bus(config)
    chipless = [part for part, table in on_a_bus.items() if not wiring.attach(part, table)]
    for part in chipless:
        driver = on_a_bus.pop(part)["driver"]
        if part != "light":
            lacks = f"rover '{config.name}': no simulated chip for '{driver}'; use --depth device"
            if driver not in BUILT_IN_DRIVERS:
                lacks += ', or name one in the driver: simulated_chip = "FILE.py:CHIP"'
            raise BadConfig(f"key 'parts.{part}.driver': {lacks}")
    rover = assemble(config.model_copy(update={"parts": on_a_bus}), buses)
    if "contact" not in on_a_bus and _has_bumper(config):
        rover = replace(rover, contact=SimBumper(world))
    return rover if "position" in on_a_bus else replace(rover, position=_receiver(world, streams, config))


def missing_package(config: RoverConfig, depth: Depth) -> str | None:
    """Say which package a rover's real drivers import that is not installed, and how to get it.

    A driver's ``packages`` are such modules, each with how to get it. None if all are there, and at device depth,
    which has no drivers.
    """
    for part, table in _on_a_bus(config).items() if depth is Depth.BUS else ():
        for module, remedy in getattr(part_settings(part, table)[0], "packages", {}).items():
            if find_spec(module) is None:
                return f"rover '{config.name}' needs {module} for [parts.{part}], which is not installed: {remedy}"
    return None


def _on_a_bus(config: RoverConfig) -> dict[str, dict[str, Any]]:
    """Return the parts whose real drivers run at bus depth."""
    simulated = {"contact", "position"}  # if they have no chip
    return {
        part: table
        for part, table in config.parts.items()
        if part not in simulated or chip_of(part, table)[0] is not None
    }


def _receiver(world: SimulatedWorld, streams: RandomStreams, config: RoverConfig) -> SimReceiver | None:
    return SimReceiver(world, streams) if "position" in config.parts else None


def _wheels(world: SimulatedWorld, config: RoverConfig) -> SimWheels | None:
    """Return the sensor of the wheels, if the file has one, or its rover is to notice by it that it is stuck."""
    if "wheels" in config.parts:
        return SimWheels(world, **_quanta("wheels", config))
    way, current = "wheels" in config.sources, "current" in config.sources
    return SimWheels(world, way=way, current=current) if way or current else None


def _has_bumper(config: RoverConfig) -> bool:
    """Return whether the rover of the file has one; a rover without any parts in its file has all that is simulated."""
    return "contact" in config.parts or not config.parts
