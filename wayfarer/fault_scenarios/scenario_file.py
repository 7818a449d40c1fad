"""Scenario files: a user's faults in TOML, validated before anything runs.

A file holds one or many ``[[scenario]]``, each with its ``[[scenario.fault]]``; ``docs/reference/faults.md`` has one.
What is wrong with a file is told in one line: file, scenario, key, what is allowed, and on which line it stands.
"""

from __future__ import annotations

import tomllib
from dataclasses import field, fields, make_dataclass, replace
from difflib import get_close_matches
from functools import cache
from math import inf
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

from annotated_types import MinLen

from wayfarer.config.messages import located, validated
from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import RoverConfig, laid_over
from wayfarer.config.rover_path import is_rover_file
from wayfarer.errors import BadConfig, BadInput, UnknownName, one_line
from wayfarer.fault_scenarios.scenario import (
    OVERLAY,
    Command,
    Duration,
    Expectation,
    Line,
    Moment,
    ResponseLevel,
    Scenario,
    misfit,
    rover_of,
)
from wayfarer.files import read_regular
from wayfarer.hal import CompassReading, ContactReading, MotionReading, PositionFix
from wayfarer.simhal.faults.kinds import KINDS, Fault

MOST = 100  # scenarios in a file
FILE_BYTES = 1_000_000
READINGS = {"compass": CompassReading, "motion": MotionReading, "contact": ContactReading, "position": PositionFix}
# Tables within a [[scenario]], each checked by itself; the other keys are fields of ``Scenario``.
TABLES: tuple[Any, ...] = (
    ("expect", dict[str, Any]),
    ("fault", Annotated[list[dict[str, Any]], MinLen(1)]),
    ("command", list[dict[str, Any]], field(default_factory=list)),
)


class _FileLocation(NamedTuple):
    """Where in a file something is: for the one line that says what is wrong with it.

    ``section`` is the table as ``line_of`` counts it, ``shown`` what a person reads before its keys.
    """

    where: str
    text: str
    section: str = ""
    shown: str = ""

    def within(self, section: str, shown: str = "") -> _FileLocation:
        """Return the place of a table in this one."""
        return self._replace(section=f"{self.section}.{section}".lstrip("."), shown=shown)

    def error(self, said: str) -> BadConfig:
        """Return what is wrong, with its line: the key's, or that of the table which lacks it."""
        return BadConfig(located(self.where, self.text, said, self.section, self.shown))

    def check(self, kind: Any, table: dict[str, Any]) -> Any:
        """Return a table as a dataclass.

        Raises:
            BadConfig: it cannot be one.
        """
        try:
            return validated(kind, table, self.shown)
        except BadConfig as error:
            raise self.error(str(error)) from None


def read_scenarios(path: Path) -> tuple[Scenario, ...]:
    """Return the scenarios of a file, in its order.

    Raises:
        BadConfig: the file cannot be read or is not right; the text names file, scenario, key and line.
    """
    file = _FileLocation(str(path), _text_of(path))
    scenarios = tuple(
        _scenario(file._replace(section=f"scenario.{number}"), table, path.parent)
        for number, table in enumerate(_tables(file))
    )
    for number, scenario in enumerate(scenarios):
        if scenario.name in {earlier.name for earlier in scenarios[:number]}:
            raise file.within(f"scenario.{number}").error(
                f"key 'name' = '{scenario.name}': there is another of that name"
            )
    return scenarios


def _text_of(path: Path) -> str:
    try:
        return read_regular(path, FILE_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        raise BadConfig(f"{path}: no such file; docs/reference/faults.md shows how to write one") from None
    except OSError as error:
        raise BadConfig(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # no UTF-8, or a name that no file can have
        raise BadConfig(one_line(f"{path}: cannot be read: {error}")) from None


def _tables(file: _FileLocation) -> list[dict[str, Any]]:
    """Return the file's ``[[scenario]]`` tables."""
    try:
        whole = tomllib.loads(file.text + "\n")  # the end of line lets the parser name the line of the last error
    except (ValueError, RecursionError) as error:
        raise file.error(f"not valid TOML: {error}") from None
    if others := [key for key in whole if key != "scenario"]:
        near = "; did you mean 'scenario'?" if get_close_matches("scenario", others, n=1) else ""
        raise file.error(f"unknown key '{others[0]}'{near or '; all of a file stands in [[scenario]] tables'}")
    tables = whole.get("scenario", [])
    if not (isinstance(tables, list) and all(isinstance(table, dict) for table in tables)):
        raise file.error("key 'scenario': write [[scenario]], in double brackets")
    if not 1 <= len(tables) <= MOST:
        raise file.error(f"{len(tables) or 'no'} [[scenario]] in the file; allowed are 1 to {MOST}")
    return tables


def _scenario(place: _FileLocation, table: dict[str, Any], folder: Path) -> Scenario:
    name = table.get("name")
    place = place._replace(where=f"{place.where}: scenario {name!r}" if isinstance(name, str) else place.where)
    checked = place.check(_scenario_table(), table)
    own = {key: getattr(checked, key) for key in table if key not in {name for name, *_ in TABLES}}
    if is_rover_file(checked.rover):
        own["rover"] = str(folder / checked.rover)
    if "command" in table:
        own["commands"] = tuple(
            place.within(f"command.{number}", "command.").check(Command, command)
            for number, command in enumerate(checked.command)
        )
    faults = tuple(
        _fault(place.within(f"fault.{number}", "fault."), fault) for number, fault in enumerate(checked.fault)
    )
    own.setdefault("about", "; ".join(map(str, faults)))
    scenario = Scenario(expect=_expectation(place.within("expect", "expect."), checked.expect), faults=faults, **own)
    _check_whole(place, scenario)
    return scenario


@cache
def _scenario_table() -> type:
    """Return what is allowed in a ``[[scenario]]``."""
    own = _fields_of(Scenario, apart=("about", "expect", "faults", "commands"))
    return make_dataclass("ScenarioTable", [*own, ("about", Line, ""), *TABLES], kw_only=True)


def _expectation(place: _FileLocation, table: dict[str, Any]) -> Expectation:
    nothing = {"within_s": 0.0} if table.get("level") == ResponseLevel.NONE.value else {}
    expectation: Expectation = place.check(Expectation, nothing | table)
    return expectation


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
    checked = place.check(_fault_table(name), table)
    params: Any = kind(**{each.name: getattr(checked, each.name) for each in fields(kind)})
    measured = _measured(checked.target)
    if getattr(params, "of", None) not in {None, *measured}:
        raise place.error(f"key 'fault.of' = '{params.of}': a {checked.target} measures {_either(measured)}")
    return Fault(checked.at_s, checked.for_s, checked.target, name, params)


@cache
def _fault_table(kind: str) -> type:
    """Return what is allowed in the table of a fault: of every fault, and of this kind."""
    every: list[Any] = [("at_s", Moment), ("target", str), ("kind", str), ("for_s", Duration, inf)]
    return make_dataclass("FaultTable", [*every, *_fields_of(KINDS[kind])], kw_only=True)


def _fields_of(kind: type, apart: tuple[str, ...] = ()) -> list[tuple[str, Any, Any]]:
    """Return name, type with its range, and default of a dataclass's fields."""
    hints = get_type_hints(kind, include_extras=True)
    return [
        (each.name, hints[each.name], field(default=each.default)) for each in fields(kind) if each.name not in apart
    ]


def _measured(target: str) -> tuple[str, ...]:
    """Return the numbers in the readings of a part."""
    reading = READINGS.get(target)
    return () if reading is None else tuple(name for name, hint in get_type_hints(reading).items() if hint is float)


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
            raise place.within(OVERLAY, f"{OVERLAY}.").error(str(error)) from None
    _check_times(place, scenario)
    _check_fit(place, scenario, config)


def _check_times(place: _FileLocation, scenario: Scenario) -> None:
    times = {"fault": [each.at_s for each in scenario.faults], "command": [each.at_s for each in scenario.commands]}
    for table, at in times.items():
        for number, at_s in enumerate(at):
            if at_s >= scenario.for_s:
                over = f"key '{table}.at_s' = {at_s:g}: the scenario is over at for_s = {scenario.for_s:g}"
                raise place.within(f"{table}.{number}", f"{table}.").error(over)


def _check_fit(place: _FileLocation, scenario: Scenario, config: RoverConfig) -> None:
    for number, fault in enumerate(scenario.faults):
        if why := misfit(config, scenario.depth, fault):
            raise place.within(f"fault.{number}", "fault.").error(f"key 'fault.target' = '{fault.target}': {why}")


def _either(names: tuple[str, ...]) -> str:
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names) or "no numbers"
