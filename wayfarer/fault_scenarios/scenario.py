"""A scenario as data: the rover, the faults and their times, operator commands, and expectations.

Its rover is a rover file with the scenario's settings laid over it; ``misfit`` says whether a fault applies to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any, Literal

from annotated_types import Interval, MaxLen, MinLen
from pydantic import Field

from wayfarer.config.factory import NEEDED
from wayfarer.config.rover_file import RoverConfig, laid_over, load_rover
from wayfarer.safety.conditions import Level
from wayfarer.simhal.build_rover import Depth
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.kinds import Fault, misplaced

LONGEST_S = 3600.0  # of a scenario
OVERLAY = "settings"  # the table's name in a scenario file

Moment = Annotated[float, Interval(ge=0, le=LONGEST_S)]
Duration = Annotated[float, Interval(gt=0, le=LONGEST_S)]
Line = Annotated[str, MaxLen(200)]


class ResponseLevel(StrEnum):
    """How severely the rover answered; the levels of the fault catalogue."""

    NONE = "-"
    NOTE = "S0"
    DEGRADE = "S1"
    HOLD = "S2"
    FAULT = "S3"
    DEADMAN = "S4"


RESPONSE_LEVELS: Mapping[Level, ResponseLevel] = {
    Level.WELL: ResponseLevel.NONE,
    Level.NOTE: ResponseLevel.NOTE,
    Level.DEGRADE: ResponseLevel.DEGRADE,
    Level.HOLD: ResponseLevel.HOLD,
    Level.FAULT: ResponseLevel.FAULT,
}


@dataclass(frozen=True, slots=True)
class Command:
    """What a person asks for at ``at_s``: ``arm``, ``disarm``, ``hold``, ``resume`` or ``stop``.

    ``heading_deg`` is where an armed rover is to go, None its own heading.
    """

    at_s: Moment
    do: Literal["arm", "disarm", "hold", "resume", "stop"]
    heading_deg: Annotated[float, Interval(ge=0, lt=360)] | None = None


@dataclass(frozen=True, slots=True)
class Expectation:
    """What must come of the faults.

    ``level`` is the severest level that is reached, ``causes`` the conditions or events of which one must tell it
    (none: any). It must be there ``within_s`` after the first fault begins, and at S2 and above the wheels must have
    been commanded to stop by then. ``event`` must be in the log. The run must end by one of the reasons in ``ends``.
    ``answer`` names events of the escape logic (``follow.anomaly``) of which one must come ``within_s``, ``never`` what
    must not come: events, conditions, answers. No two ticks may be further apart than ``ticks_within_s``. Where the
    motor board stops the wheels sooner than the rover notices anything, ``stands_within_s`` is the bound for that.
    """

    level: ResponseLevel
    within_s: Moment
    causes: tuple[str, ...] = ()
    event: str | None = None
    ends: tuple[str, ...] = ()
    answer: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    ticks_within_s: Moment | None = None
    stands_within_s: Moment | None = None


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario; the ranges are those of a scenario file.

    ``row`` is its number in the fault catalogue, None for a user's own; ``asked`` the level that the catalogue asks
    for, and ``because`` why another one is expected here. ``settings`` are laid over the rover file.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]  # of a folder in --out, too
    about: Line
    expect: Expectation
    faults: tuple[Fault, ...]
    row: Annotated[int, Interval(ge=1, le=99)] | None = None
    asked: Line = ""
    because: Annotated[str, MaxLen(500)] = ""
    rover: Annotated[str, MinLen(1)] = "forestrover"
    depth: Depth = Depth.BUS
    algorithm: str = "forest-pledge"
    for_s: Duration = 20.0
    seed: Annotated[int, Interval(ge=0, le=2**31 - 1)] = 0
    slip_mean_m: Annotated[float, Interval(gt=0, le=1e6)] = 10.0
    clearing: bool = False
    commands: tuple[Command, ...] = (Command(0.0, "arm", 0.0),)
    settings: dict[str, Any] | None = None


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
