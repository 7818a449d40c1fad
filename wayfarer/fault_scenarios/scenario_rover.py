"""The rover of a scenario: its file, the scenario's changes, and whether the faults apply to it."""

from __future__ import annotations

from wayfarer.config.factory import NEEDED
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.config.rover_overlay import laid_over
from wayfarer.fault_scenarios.scenario import Scenario
from wayfarer.simhal.build_rover import Depth
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.kinds import Fault, misplaced

OVERLAY = "settings"  # the table's name in a scenario file


def rover_of(scenario: Scenario) -> RoverConfig:
    """Return the scenario's rover, with what the scenario lays over it.

    Raises:
        UnknownName: no shipped rover of that name.
        BadConfig: its file, or what is laid over it, is not right.
    """
    config = load_rover(scenario.rover)
    return laid_over(config, scenario.settings, f"{OVERLAY}.") if scenario.settings else config


def misfit(config: RoverConfig, depth: Depth, fault: Fault) -> str | None:
    """Return why a fault does not apply to a rover at a depth, None where it can."""
    if isinstance(fault.params, BusFault) and depth is not Depth.BUS:
        return f"kind '{fault.kind}' happens on a bus: it needs depth = \"bus\""
    if depth is Depth.BUS and (missing := [part for part in NEEDED if part not in config.parts]):
        return f"rover '{config.name}' has no [parts.{missing[0]}], so no driver to run; it needs depth = \"device\""
    if config.parts and fault.target not in {"world", "process", *config.parts}:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    return misplaced(fault, config) if isinstance(fault.params, BusFault) else None
