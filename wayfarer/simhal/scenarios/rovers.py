"""The rover of a scenario: its file, what the scenario lays over it, and whether the faults can happen to it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from wayfarer.config.factory import NEEDED
from wayfarer.config.messages import explain, most_telling
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.errors import BadConfig
from wayfarer.simhal.faults import KINDS, Fault, Layer
from wayfarer.simhal.injection.bus_layer import misplaced
from wayfarer.simhal.rig import Depth
from wayfarer.simhal.scenarios.scenario import Scenario

OVERLAY = "settings"  # the table's name in a scenario file


def rover_of(scenario: Scenario) -> RoverConfig:
    """Return the scenario's rover, with what the scenario lays over it.

    Raises:
        UnknownName: no shipped rover of that name.
        BadConfig: its file, or what is laid over it, is not right.
    """
    config = load_rover(scenario.rover)
    return laid_over(config, scenario.settings) if scenario.settings else config


def laid_over(config: RoverConfig, settings: Mapping[str, Any], prefix: str = f"{OVERLAY}.") -> RoverConfig:
    """Return a rover with some settings changed, as validated as a rover file; an error puts ``prefix`` before a key.

    Raises:
        BadConfig: the text names the key and what is allowed.
    """
    table = _merged(config.model_dump(mode="json"), settings)
    try:
        return RoverConfig.model_validate_json(json.dumps(table, default=str), strict=True)
    except ValidationError as error:
        raise BadConfig(explain(most_telling(error), RoverConfig, prefix)) from None


def misfit(config: RoverConfig, depth: Depth, fault: Fault) -> str | None:
    """Say why a fault cannot happen to a rover at a depth, None where it can."""
    if KINDS[fault.kind].layer is Layer.BUS and depth is not Depth.BUS:
        return f"kind '{fault.kind}' is on a bus: it needs depth = \"bus\""
    if depth is Depth.BUS and (missing := [part for part in NEEDED if part not in config.parts]):
        return f"rover '{config.name}' has no [parts.{missing[0]}] to run the driver of; it needs depth = \"device\""
    if config.parts and fault.target not in {"world", "process", *config.parts}:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    return misplaced(fault, config) if KINDS[fault.kind].layer is Layer.BUS else None


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return two tables as one, where the upper one counts; tables within them are merged too."""
    merged = dict(below)
    for key, value in above.items():
        under = merged.get(key)
        merged[key] = _merged(under, value) if isinstance(under, Mapping) and isinstance(value, Mapping) else value
    return merged
