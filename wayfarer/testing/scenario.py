"""A scenario as data: the rover, the faults and their times, operator commands, and expectations; and files of them.

Its rover is a rover file with the scenario's settings laid over it. A file holds one or many ``[[scenario]]``, each
with its ``[[scenario.fault]]``; ``docs/reference/faults.md`` has one. What is wrong with a file is one line:
file, scenario, key, what is allowed, and on which line it is.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from difflib import get_close_matches
from enum import StrEnum
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

from annotated_types import Interval, MaxLen, MinLen
from pydantic import Field

from wayfarer.config.messages import located, validated
from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import RoverConfig, laid_over, load_rover
from wayfarer.config.rover_path import is_rover_file
from wayfarer.errors import BadConfig, BadInput, UnknownName, one_line
from wayfarer.files import read_regular
from wayfarer.safety.conditions import Level
from wayfarer.simhal.faults.kinds import KINDS, Fault, measured, misfit, parts_of
from wayfarer.simhal.world.physics import Depth

T = TypeVar("T")

LONGEST_S = 3600.0  # of a scenario
MOST = 100  # scenarios in a file
FILE_BYTES = 1_000_000
OVERLAY = "settings"  # the table's name in a file

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

    ``level`` is the severest level that is reached, ``causes`` the conditions or events of which one must report it
    (none: any). It must be there ``within_s`` after the first fault begins, and at S2 and above the wheels must have
    been commanded to stop by then. ``event`` must be in the log. The run must end by one of the reasons in ``ends``.
    ``answer`` names events of the escape logic (``follow.anomaly``) of which one must come ``within_s``, ``never`` what
    must not come: events, conditions, answers. No two ticks may be further apart than ``ticks_within_s``. If the motor
    board stops the wheels sooner than the rover notices anything, ``stands_within_s`` is the bound for that.
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


@dataclass(frozen=True, kw_only=True)
class ScenarioSettings:
    """What a scenario says beside its faults, commands and expectations; the ranges are those of a file.

    ``row`` is its number in the fault catalogue, None for a user's own; ``asked`` the level that the catalogue asks
    for, and ``because`` why another one is expected here. ``settings`` are laid over the rover file.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]
    about: Line = ""
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
    settings: dict[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
class Scenario(ScenarioSettings):
    """One scenario: faults, and what must come of them."""

    expect: Expectation
    faults: tuple[Fault, ...]
    commands: tuple[Command, ...] = (Command(0.0, "arm", 0.0),)


@dataclass(frozen=True, kw_only=True)
class _ScenarioTable(ScenarioSettings):
    """A ``[[scenario]]`` of a file, whose tables are checked each by itself."""

    expect: dict[str, Any]
    fault: Annotated[list[dict[str, Any]], MinLen(1)]
    command: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class _FaultTable:
    """What every ``[[scenario.fault]]`` has; its other keys are the parameters of its kind."""

    at_s: Moment
    for_s: Duration = inf
    target: str
    kind: str


_TABLES = ("expect", "fault", "command")


def rover_of(scenario: Scenario) -> RoverConfig:
    """Return the scenario's rover, with what the scenario lays over it.

    Raises:
        UnknownName: no shipped rover of that name.
        BadConfig: its file, or what is laid over it, is not right.
    """
    config = load_rover(scenario.rover)
    return laid_over(config, scenario.settings, f"{OVERLAY}.") if scenario.settings else config


class _FileLocation(NamedTuple):
    """Where in a file something is: file, scenario and table, and what a person reads before the table's keys."""

    where: str
    prefix: str = ""

    def within(self, table: str, number: int | None = None) -> _FileLocation:
        """Return the place of a table in this one; of several tables also which one, as 1, 2, 3."""
        where = self.where if number is None else f"{self.where}: {table} {number + 1}"
        return _FileLocation(where, f"{table}.")

    def error(self, said: str) -> BadConfig:
        """Return what is wrong."""
        return BadConfig(located(self.where, said))

    def check(self, kind: type[T], table: Mapping[str, Any]) -> T:
        """Return a table as a dataclass.

        Raises:
            BadConfig: it cannot be one.
        """
        try:
            return validated(kind, table, self.prefix)
        except BadConfig as error:
            raise self.error(str(error)) from None


def read_scenarios(path: Path) -> tuple[Scenario, ...]:
    """Return the scenarios of a file, in its order.

    Raises:
        BadConfig: the file cannot be read or is not right; the text names file, scenario, table and key.
    """
    file = _FileLocation(str(path))
    scenarios = tuple(
        _scenario(_FileLocation(f"{path}: scenario {table.get('name', number + 1)!r}"), table, path.parent)
        for number, table in enumerate(_scenario_tables(file, _text_of(path)))
    )
    for number, scenario in enumerate(scenarios):
        if scenario.name in {earlier.name for earlier in scenarios[:number]}:
            raise file.error(f"key 'name' = '{scenario.name}': there is another of that name")
    return scenarios


def _text_of(path: Path) -> str:
    try:
        return read_regular(path, FILE_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        raise BadConfig(
            f'{path}: no such file; the documentation\'s page "Faults on purpose" shows how to write one'
        ) from None
    except OSError as error:
        raise BadConfig(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # no UTF-8, or a name that no file can have
        raise BadConfig(one_line(f"{path}: cannot be read: {error}")) from None


def _scenario_tables(file: _FileLocation, text: str) -> list[dict[str, Any]]:
    try:
        whole = tomllib.loads(text + "\n")  # the end of line lets the parser name the line of the last error
    except (ValueError, RecursionError) as error:
        raise file.error(f"not valid TOML: {error}") from None
    if others := [key for key in whole if key != "scenario"]:
        near = "; did you mean 'scenario'?" if get_close_matches("scenario", others, n=1) else ""
        raise file.error(f"unknown key '{others[0]}'{near or '; a file has [[scenario]] tables only'}")
    tables = whole.get("scenario", [])
    if not (isinstance(tables, list) and all(isinstance(table, dict) for table in tables)):
        raise file.error("key 'scenario': write [[scenario]], in double brackets")
    if not 1 <= len(tables) <= MOST:
        raise file.error(f"{len(tables) or 'no'} [[scenario]] in the file; allowed are 1 to {MOST}")
    return tables


def _scenario(place: _FileLocation, table: dict[str, Any], folder: Path) -> Scenario:
    checked = place.check(_ScenarioTable, table)
    own = {key: value for key, value in asdict(checked).items() if key not in _TABLES}
    if is_rover_file(checked.rover):
        own["rover"] = str(folder / checked.rover)
    if "command" in table:
        own["commands"] = tuple(
            place.within("command", number).check(Command, command) for number, command in enumerate(checked.command)
        )
    faults = tuple(_fault(place.within("fault", number), fault) for number, fault in enumerate(checked.fault))
    own["about"] = checked.about or "; ".join(map(str, faults))
    nothing = {"within_s": 0.0} if checked.expect.get("level") == ResponseLevel.NONE.value else {}
    expect = place.within("expect").check(Expectation, nothing | checked.expect)
    scenario = Scenario(expect=expect, faults=faults, **own)
    _check_whole(place, scenario)
    return scenario


def _fault(place: _FileLocation, table: dict[str, Any]) -> Fault:
    name = table.get("kind")
    if name is None:
        mistyped = get_close_matches("kind", table, n=1)
        unknown = f"unknown key 'fault.{mistyped[0]}'; did you mean 'kind'?" if mistyped else ""
        raise place.error(unknown or "key 'fault.kind' is missing")
    if not (isinstance(name, str) and name in KINDS):
        raise place.error(f"key 'fault.kind': {UnknownName('kind of fault', str(name), KINDS)}")
    kind, target = KINDS[name], table.get("target")
    if target is not None and target not in kind.targets:
        raise place.error(f"key 'fault.target' = {target!r}: '{name}' applies to {_either(kind.targets)}")
    own = {each.name for each in fields(_FaultTable)}
    params: Any = place.check(kind, {key: value for key, value in table.items() if key not in own})
    checked = place.check(_FaultTable, {key: value for key, value in table.items() if key in own})
    if checked.target not in parts_of(params):
        numbers = _either(measured(checked.target))
        raise place.error(f"key 'fault.of' = '{params.of}': a {checked.target} measures {numbers}")
    return Fault(checked.at_s, checked.for_s, checked.target, name, params)


def _check_whole(place: _FileLocation, scenario: Scenario) -> None:
    """Refuse what is right by itself and does not fit together."""
    try:
        config = rover_of(replace(scenario, settings=None))
    except BadInput as error:
        raise place.error(f"key 'rover': {error}") from None
    try:
        find_algorithm(scenario.algorithm)
    except BadInput as error:
        raise place.error(f"key 'algorithm': {error}") from None
    if scenario.settings:
        try:
            config = laid_over(config, scenario.settings, f"{OVERLAY}.")
        except BadConfig as error:
            raise place.error(str(error)) from None
    times = {"fault": [each.at_s for each in scenario.faults], "command": [each.at_s for each in scenario.commands]}
    for table, at in times.items():
        for number, at_s in enumerate(at):
            if at_s >= scenario.for_s:
                over = f"key '{table}.at_s' = {at_s:g}: the scenario is over at for_s = {scenario.for_s:g}"
                raise place.within(table, number).error(over)
    for number, fault in enumerate(scenario.faults):
        if why := misfit(fault, config, scenario.depth):
            raise place.within("fault", number).error(f"key 'fault.target' = '{fault.target}': {why}")


def _either(names: tuple[str, ...]) -> str:
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names) or "no numbers"
