"""Faults as data: what goes wrong, with what, from when to when; the names of all kinds, and the option ``--fault``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from inspect import isabstract
from math import inf
from typing import Any

from wayfarer.config.factory import NEEDED
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import BadInput, UnknownName
from wayfarer.hal import CompassReading, ContactReading, MotionReading, PositionFix, WheelReading
from wayfarer.simhal.faults import bus, process, readings, world
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.fault_kind import PARTS, FaultKind
from wayfarer.simhal.faults.wires import is_on
from wayfarer.simhal.world.physics import Depth

BEGINS_S = 5.0  # of ``--fault`` without a time: the rover has driven some metres by then; chosen by us
MOST_S = 1e6  # of its times

# A reading of each part, to see what is a number in it.
_READINGS: Mapping[str, Any] = {
    "compass": CompassReading(0.0, 0.0, 0.0, 0.0, None),
    "motion": MotionReading(0.0, 0.0, 0.0, 0.0),
    "contact": ContactReading(0.0, (), None),
    "wheels": WheelReading(0.0, 0.0, 0.0, 0.0, 0.0),
    "position": PositionFix(0.0, 0.0, 0.0, None),
}
# What the name of a class becomes: NotANumber is not_a_number in scenario files and logs, AllFF is all_ff.
_NEW_WORD = re.compile("(?<=[a-z])(?=[A-Z0-9])|(?<=[A-Z])(?=[A-Z][a-z])")


KINDS: Mapping[str, type[FaultKind]] = {
    _NEW_WORD.sub("_", kind.__name__).lower(): kind
    for module in (world, readings, bus, process)
    for kind in vars(module).values()
    if isinstance(kind, type) and issubclass(kind, FaultKind) and not isabstract(kind)
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


def parse_fault(text: str) -> Fault:
    """Return the fault that ``--fault`` asks for, as ``KIND[:PART][@SECONDS[+SECONDS]]``.

    It begins so many seconds after arming (``BEGINS_S`` if nothing is said), and lasts for the seconds after the
    plus, else to the end. The part may be left out if the kind can happen to one only. Its parameters are the defaults
    of its kind, or what is ``typical`` if these change nothing.

    Raises:
        UnknownName: no such kind, or it cannot happen to that part; the text offers the nearest names.
        BadInput: the part is missing, or a time is out of its range.
    """
    what, at, times = text.partition("@")
    name, colon, part = what.partition(":")
    if name not in KINDS:
        raise UnknownName("kind of fault", name, KINDS)
    params = KINDS[name](**KINDS[name].typical)
    parts = parts_of(params)
    if not colon and len(parts) > 1:
        raise BadInput(f"--fault {text}: name the part: {', '.join(f'{name}:{each}' for each in parts)}")
    if colon and part not in parts:
        raise UnknownName(f"part for --fault {name}", part, parts)
    begins, plus, lasting = times.partition("+")
    at_s = _seconds(text, begins) if at else BEGINS_S
    for_s = _seconds(text, lasting) if plus else inf
    if not for_s:
        raise BadInput(f"--fault {text}: it must last longer than 0 s")
    return Fault(at_s, for_s, part or parts[0], name, params)


def _seconds(text: str, value: str) -> float:
    try:
        seconds = float(value)
    except ValueError:
        seconds = -1.0
    if not 0.0 <= seconds <= MOST_S:
        raise BadInput(
            f"--fault {text}: '{value}' is not a time from 0 to {MOST_S:,.0f} s; write KIND:PART@SECONDS+SECONDS, "
            "such as silent:compass@20+5"
        )
    return seconds


def parts_of(params: FaultKind) -> tuple[str, ...]:
    """Return to what a fault with these parameters can happen: the targets that measure the value that it changes."""
    of = getattr(params, "of", None)
    return params.targets if of is None else tuple(part for part in params.targets if of in measured(part))


def measured(part: str) -> tuple[str, ...]:
    """Return the names of the numbers in the readings of a part."""
    values = _READINGS[part]._asdict() if part in _READINGS else {}
    return tuple(name for name, value in values.items() if isinstance(value, float))


def misfit(fault: Fault, config: RoverConfig, depth: Depth) -> str | None:
    """Return why a fault cannot happen to a simulated rover at a depth, None if it can."""
    if isinstance(fault.params, BusFault) and depth is not Depth.BUS:
        return f"kind '{fault.kind}' happens on a bus: it needs depth \"bus\""
    if depth is Depth.BUS and (missing := [part for part in NEEDED if part not in config.parts]):
        return f"rover '{config.name}' has no [parts.{missing[0]}], so no driver to run; it needs depth \"device\""
    without = set() if config.parts else {*PARTS} - {"position"}  # a file without parts has all that is simulated
    if fault.target not in {"world", "process", *config.parts, *without}:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    return misplaced(fault, config) if isinstance(fault.params, BusFault) else None


def misplaced(fault: Fault, config: RoverConfig) -> str | None:
    """Return why a fault of a bus does not apply to a rover, None if it can."""
    if fault.target not in config.parts:
        return f"rover '{config.name}' has no [parts.{fault.target}]"
    if is_on(fault.target, fault.params.fits, config):
        return None
    driver = config.parts[fault.target]["driver"]
    return f"rover '{config.name}': '{fault.kind}' does not apply to driver = \"{driver}\""
