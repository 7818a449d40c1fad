"""Reads ``campaign.json``: what a folder says that its campaign or sweep was.

The folder may have come from somebody else. So what it names is neither imported nor opened until ``rebuild`` has
checked it: a rover, algorithms and forests are only names and numbers.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from wayfarer.config.messages import key_and_problem, shown
from wayfarer.config.own_file import OwnFile
from wayfarer.config.registry import refuse_code
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import BadInput, one_line
from wayfarer.experiments.campaign import Axis, Campaign, Plan
from wayfarer.experiments.keys import BODY, FOOTPRINT, check_keys, check_ranges
from wayfarer.experiments.settings import MOST_DIGITS, MOST_TRIALS, NAMES, NO_NUMBER_REACHES, checked_plain
from wayfarer.experiments.sweep import MOST_AXES, Sweep
from wayfarer.files import read_regular
from wayfarer.simhal.world.forest_file import ForestFile, read_forest_file

SETTINGS = "campaign.json"
FORESTS = "forests.jsonl"
T = TypeVar("T")

MOST_BYTES = 10_000_000  # a sweep of two keys with all the values that fit a command line has less


def _is_name(text: str) -> str:
    if not text.isprintable():
        raise ValueError("it has control characters")
    return text


def _is_fault(text: str) -> str:
    from wayfarer.simhal.faults.kinds import parse_fault  # imports numpy: only campaigns with faults need it

    try:
        parse_fault(text)
    except BadInput as error:
        raise ValueError(str(error)) from None
    return text


class _ForestsSource(BaseModel):
    """Which file the forests came from: its name, and the checksum of its content."""

    file: str
    blake2b: str


def _drawable(value: float) -> float:
    if not abs(value) < NO_NUMBER_REACHES:
        raise ValueError(f"expected a number below 1e{MOST_DIGITS + 1}")
    return value


def _has_body(rover: dict[str, Any]) -> dict[str, Any]:
    vehicle = rover.get("vehicle")
    if not (isinstance(vehicle, dict) and all(isinstance(vehicle.get(key), int | float) for key in BODY_KEYS)):
        raise ValueError(f"vehicle: expected a table with the numbers {' and '.join(BODY_KEYS)}")
    return rover


BODY_KEYS = [key.rpartition(".")[2] for key in BODY]
Name = Annotated[str, AfterValidator(_is_name)]
Number = Annotated[int | float, AfterValidator(_drawable)]


class _AxisAsWritten(BaseModel):
    """What a sweep varies."""

    model_config = ConfigDict(strict=True)

    key: Name
    values: Annotated[list[bool | Number | Name], Field(min_length=1)]
    now: bool | Number | Name | None


class _OwnFileAsWritten(BaseModel):
    """Which file somebody's own algorithm or driver was in."""

    model_config = ConfigDict(strict=True)

    path: Name
    blake2b: Name


class _AsWritten(BaseModel):
    """The settings that people write in another form than ``campaign.json`` has them; none may be missing."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    version: Name
    algorithms: Annotated[list[Name], Field(min_length=1)]
    rover: Annotated[dict[str, Any], AfterValidator(_has_body)]
    forests: _ForestsSource | None
    site: str | None
    set: dict[Name, bool | Number | Name | tuple[Number, Number]]
    faults: list[Annotated[str, AfterValidator(_is_fault)]]
    files: dict[Name, _OwnFileAsWritten] = {}
    axes: Annotated[list[_AxisAsWritten], Field(max_length=MOST_AXES)] = []


def recorded(table: Any) -> Plan:
    """Return the campaign or sweep of a ``campaign.json``, as its ``settings`` wrote it.

    Nothing that it names is imported or opened: its rover, its algorithms and its forests are only names and numbers
    until ``Results.rebuild`` has checked them.

    Raises:
        ValueError: it cannot be one; the text says why.
    """
    from wayfarer.simhal.world.sites import SITES

    if isinstance(table, dict) and (missing := [name for name in ("version", *NAMES) if name not in table]):
        raise ValueError(f"{missing[0]} is missing, as in results of another version")
    found = _AsWritten.model_validate_json(json.dumps(table))
    if len(set(found.algorithms)) < len(found.algorithms):
        raise ValueError("algorithms: one is there twice")
    for key in (FOOTPRINT, *BODY):
        values = [found.set.get(key, 0.0), *(value for axis in found.axes if axis.key == key for value in axis.values)]
        if any(isinstance(value, str | bool) for value in values):
            raise ValueError(f"set: {key}: expected a number")
    if found.site is not None and found.site not in SITES:
        raise ValueError(f"site: there is no {shown(found.site)}; there are {', '.join(SITES)}")
    try:
        plain = checked_plain(table)
    except BadInput as error:
        raise ValueError(str(error)) from None
    campaign = Campaign(
        tuple(found.algorithms),
        rover=RoverConfig.model_construct(**{"name": "unnamed"} | found.rover),
        forests=None if found.forests is None else ForestFile(found.forests.file, found.forests.blake2b, ()),
        site=found.site,
        set=found.set,
        faults=tuple(found.faults),
        version=found.version,
        files={name: OwnFile(file.path, file.blake2b) for name, file in found.files.items()},
        **plain,
    )
    if not found.axes:
        return campaign
    sweep = Sweep(campaign, tuple(Axis(axis.key, tuple(axis.values), axis.now) for axis in found.axes))
    if sweep.total > MOST_TRIALS:
        raise ValueError(f"{sweep.total:,} trials, allowed are {MOST_TRIALS:,}")
    return sweep


def read_plan(folder: Path) -> Plan:
    """Return what the ``campaign.json`` of a folder holds.

    Raises:
        BadInput: it cannot be read, or no such settings are in it.
    """
    return _read(folder / SETTINGS, recorded)


def _read(path: Path, read: Callable[[Any], T]) -> T:
    try:
        return read(json.loads(read_regular(path, MOST_BYTES)))
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise BadInput(f"{path} is damaged: {key_and_problem(error)}; the campaign must be run again") from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path} is damaged: {one_line(error)}; the campaign must be run again") from None


def rebuild(campaign: Campaign, folder: Path, *, allow_code: bool = False) -> Campaign:
    """Return the campaign that a folder has, so that its trials can be run again.

    Args:
        campaign: as ``read_plan`` gives it.
        folder: where its forests are.
        allow_code: import what the settings name as a file or ``"module:attribute"``, which may be any one.

    Raises:
        BadInput: this version does not understand the rover, the forests are not in the folder, or the settings
            name code that must not be imported.
    """
    rover = _read(folder / SETTINGS, dict)["rover"]  # with keys that this version lacks
    if not allow_code:
        values = (value for value in campaign.set.values() if isinstance(value, str))
        files = (f"{file.path}:" for file in campaign.files.values())  # a trial executes each
        refuse_code(*campaign.algorithms, *_names(rover), *values, *files)
    try:
        checked = RoverConfig.model_validate_json(json.dumps(rover), strict=True)
    except ValidationError:
        raise BadInput(f"this version does not understand the rover of version {campaign.version}") from None
    campaign = replace(campaign, rover=checked, forests=_forests(campaign.forests, folder))
    check_keys(campaign, list(campaign.set))
    return check_ranges(campaign)


def _forests(wanted: ForestFile | None, folder: Path) -> ForestFile | None:
    if wanted is None:
        return None
    path = folder / FORESTS
    if not path.exists():
        raise BadInput(
            f"the folder has no copy of the campaign's forests; put {wanted.name} there as {FORESTS} "
            "and make the report again"
        )
    found = read_forest_file(path)
    if found.blake2b != wanted.blake2b:
        raise BadInput(
            f"{FORESTS} in the folder is not the file that the campaign used: its BLAKE2b checksum is "
            f"{found.blake2b}, not {wanted.blake2b}"
        )
    return found


def _names(rover: Mapping[str, Any]) -> Iterator[str]:
    """Yield what a rover's settings name: its buses, and the drivers of its parts."""
    parts = rover.get("parts")
    tables = list(parts.values()) if isinstance(parts, dict) else []
    yield from (str(table.get("driver")) for table in tables if isinstance(table, dict))
    yield str(rover.get("buses", ""))
