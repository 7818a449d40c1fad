"""Faults as data: what goes wrong, with what, from when to when; and the names of all kinds."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from inspect import isabstract
from math import inf
from types import ModuleType
from typing import Any

from wayfarer.config.factory import NEEDED
from wayfarer.config.rover_file import RoverConfig
from wayfarer.simhal.build_rover import Depth
from wayfarer.simhal.faults import bus, process, readings, world
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.fault_kind import FaultKind
from wayfarer.simhal.faults.wired_part import is_on

# What the name of a class becomes: NotANumber is not_a_number in scenario files and logs, AllFF is all_ff.
_NEW_WORD = re.compile("(?<=[a-z])(?=[A-Z0-9])|(?<=[A-Z])(?=[A-Z][a-z])")


def _kinds_in(module: ModuleType) -> list[type[FaultKind]]:
    classes = [each for each in vars(module).values() if isinstance(each, type) and issubclass(each, FaultKind)]
    return [each for each in classes if not isabstract(each)]


KINDS: Mapping[str, type[FaultKind]] = {
    _NEW_WORD.sub("_", kind.__name__).lower(): kind
    for module in (world, readings, bus, process)
    for kind in _kinds_in(module)
}


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that goes wrong from ``at_s`` on for ``for_s`` seconds (infinite: to the end of the run).

    ``at_s`` is seconds from the start of the run. ``target`` is a part (``compass``), or the ``world`` or the
    ``process`` itself. ``kind`` is a name of ``KINDS``, and ``params`` one of that class; None for its defaults.
    """

    at_s: float
    for_s: float
    target: str
    kind: str
    params: Any = None

    def __post_init__(self) -> None:
        if self.params is None:
            object.__setattr__(self, "params", KINDS[self.kind]())

    def __str__(self) -> str:
        """Return the fault as a person would write it down."""
        lasting = "" if self.for_s == inf else f" for {self.for_s:g} s"
        return f"{self.target} {self.kind}{lasting} from {self.at_s:g} s on"


def misfit(fault: Fault, config: RoverConfig, depth: Depth) -> str | None:
    """Return why a fault cannot happen to a simulated rover at a depth, None where it can."""
    if isinstance(fault.params, BusFault) and depth is not Depth.BUS:
        return f"kind '{fault.kind}' happens on a bus: it needs depth = \"bus\""
    if depth is Depth.BUS and (missing := [part for part in NEEDED if part not in config.parts]):
        return f"rover '{config.name}' has no [parts.{missing[0]}], so no driver to run; it needs depth = \"device\""
    if config.parts and fault.target not in {"world", "process", *config.parts}:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    return misplaced(fault, config) if isinstance(fault.params, BusFault) else None


def misplaced(fault: Fault, config: RoverConfig) -> str | None:
    """Return why a fault of a bus does not apply to a rover, None where it can."""
    if fault.target not in config.parts:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    if is_on(fault.target, fault.params.fits, config):
        return None
    driver = config.parts[fault.target]["driver"]
    return f"rover '{config.name}': '{fault.kind}' does not apply to driver = \"{driver}\""
