"""Reads the folder of a finished campaign: settings, rows, and the campaign itself if it can be rebuilt."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from wayfarer.config.messages import key_and_problem, shown
from wayfarer.config.registry import refuse_code
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import BadInput, one_line
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.keys import check_keys, check_ranges
from wayfarer.experiments.paper import Reported, reported
from wayfarer.experiments.results_folder import (
    FORESTS,
    MOST_BYTES,
    SETTINGS,
    TRIALS,
    count_of,
    in_table_order,
    read_rows,
)
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.settings import NAMES, checked_plain
from wayfarer.experiments.tables import campaign_table
from wayfarer.files import open_regular, read_regular
from wayfarer.logview.terminal_table import TextTable
from wayfarer.simhal.faults.kinds import parse_fault
from wayfarer.simhal.world.forest_file import ForestFile, read_forest_file

T = TypeVar("T")


def _is_name(text: str) -> str:
    if not text.isprintable():
        raise ValueError("it has characters that a terminal obeys")
    return text


def _is_fault(text: str) -> str:
    try:
        parse_fault(text)
    except BadInput as error:
        raise ValueError(str(error)) from None
    return text


class _ForestsSource(BaseModel):
    """Which file the forests came from: its name, and the checksum of its content."""

    file: str
    blake2b: str


class _AsWritten(BaseModel):
    """The settings that people write in another form than ``campaign.json`` has them; none may be missing."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    version: str
    algorithms: Annotated[list[Annotated[str, AfterValidator(_is_name)]], Field(min_length=1)]
    rover: dict[str, Any]
    forests: _ForestsSource | None
    site: str | None
    set: dict[str, bool | int | float | Annotated[str, AfterValidator(_is_name)] | tuple[int | float, int | float]]
    faults: list[Annotated[str, AfterValidator(_is_fault)]]


def recorded(table: Any) -> Campaign:
    """Return the campaign of a ``campaign.json``, as ``Campaign.settings`` wrote it.

    Nothing that it names is imported or opened: its rover, its algorithms and its forests are only names and numbers
    until ``CampaignResults.rebuild`` has checked them.

    Raises:
        ValueError: it cannot be one; the text says why.
    """
    from wayfarer.simhal.world.sites import SITES

    found = _AsWritten.model_validate_json(json.dumps(table))
    if missing := [name for name in NAMES if name not in table]:
        raise ValueError(f"{missing[0]}: Field required")
    if len(set(found.algorithms)) < len(found.algorithms):
        raise ValueError("algorithms: one is there twice")
    if found.site is not None and found.site not in SITES:
        raise ValueError(f"site: there is no {shown(found.site)}; there are {', '.join(SITES)}")
    try:
        plain = checked_plain(table)
    except BadInput as error:
        raise ValueError(str(error)) from None
    return Campaign(
        tuple(found.algorithms),
        rover=RoverConfig.model_construct(**{"name": "unnamed"} | found.rover),
        forests=None if found.forests is None else ForestFile(found.forests.file, found.forests.blake2b, ()),
        site=found.site,
        set=found.set,
        faults=tuple(found.faults),
        version=found.version,
        **plain,
    )


@dataclass(frozen=True)
class CampaignResults:
    """What a campaign's folder holds: ``rows`` are those of ``trials.csv``, complete and in its order."""

    folder: Path
    settings: Campaign
    rows: list[TrialRow]

    @cached_property
    def by_algorithm(self) -> dict[str, list[TrialRow]]:
        """The rows of each algorithm, in the campaign's order."""
        by_name: dict[str, list[TrialRow]] = {name: [] for name in self.settings.algorithms}
        for row in self.rows:
            by_name[row.algorithm].append(row)
        return by_name

    @cached_property
    def reported(self) -> Reported:
        """What the paper reports of such a campaign, by algorithm."""
        return reported(self.settings.settings())

    def table(self, *, full: bool) -> TextTable:
        """Return the table of the results, with the paper's figures; ``full`` as of ``campaign_table``."""
        return campaign_table(self.by_algorithm, self.reported, site=self.settings.site is not None, full=full)

    @property
    def shortest_paths_m(self) -> list[float]:
        """The shortest path of each trial, metres, as far as they are known."""
        return [row.shortest_path_m for row in self.rows if row.shortest_path_m]

    def rebuild(self, *, allow_code: bool = False) -> Campaign:
        """Return the campaign, so that its trials can be run again.

        Args:
            allow_code: import what the settings name as ``"module:attribute"``, which may be any module.

        Raises:
            BadInput: this version does not understand the rover, the forests are not in the folder, or the settings
                name code that must not be imported.
        """
        settings = self.settings
        rover = read_settings(self.folder / SETTINGS, dict, "campaign")["rover"]  # with keys that this version lacks
        if not allow_code:
            swept = (str(value) for value in settings.set.values() if not isinstance(value, tuple))
            refuse_code(*settings.algorithms, *_names(rover), *(text for text in swept if ":" in text))
        try:
            checked = RoverConfig.model_validate_json(json.dumps(rover), strict=True)
        except ValidationError:
            raise BadInput(f"this version does not understand the rover of version {settings.version}") from None
        campaign = replace(settings, rover=checked, forests=self._forests(settings.forests))
        check_keys(campaign, list(campaign.set))
        return check_ranges(campaign)

    def _forests(self, wanted: ForestFile | None) -> ForestFile | None:
        if wanted is None:
            return None
        if not (self.folder / FORESTS).exists():
            raise BadInput(
                f"the folder has no copy of the campaign's forests; put {wanted.name} there as {FORESTS} "
                "and make the report again"
            )
        found = read_forest_file(self.folder / FORESTS)
        if found.blake2b != wanted.blake2b:
            raise BadInput(
                f"{FORESTS} in the folder is not the file that the campaign used: its BLAKE2b checksum is "
                f"{found.blake2b}, not {wanted.blake2b}"
            )
        return found


def _names(rover: Mapping[str, Any]) -> Iterator[str]:
    """Give what a rover's settings name: its buses, and the drivers of its parts."""
    parts = rover.get("parts")
    tables = list(parts.values()) if isinstance(parts, dict) else []
    yield from (str(table.get("driver")) for table in tables if isinstance(table, dict))
    yield str(rover.get("buses", ""))


def read_results(folder: Path) -> CampaignResults:
    """Read the folder of a finished campaign.

    Raises:
        BadInput: no such folder, no campaign in it, not finished, or damaged; the text says which, and what to do.
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder; give one that `wayfarer sim --out` has filled")
    if not (folder / SETTINGS).exists():
        raise BadInput(f"{folder} holds no campaign: {SETTINGS} is missing; give a folder of `wayfarer sim --out`")
    settings = read_settings(folder / SETTINGS, recorded, "campaign")
    return CampaignResults(folder, settings, read_trials(folder, settings.settings(), "campaign", "sim"))


def read_settings(path: Path, read: Callable[[Any], T], kind: str) -> T:
    """Return what a file such as ``campaign.json`` or ``sweep.json`` holds; ``kind`` is what errors call its owner.

    Raises:
        BadInput: it cannot be read, or no such settings are in it.
    """
    try:
        return read(json.loads(read_regular(path, MOST_BYTES)))
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise BadInput(f"{path} is damaged: {key_and_problem(error)}; the {kind} must be run again") from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path} is damaged: {one_line(error)}; the {kind} must be run again") from None


def read_trials(folder: Path, settings: Mapping[str, Any], kind: str, command: str) -> list[TrialRow]:
    """Return the rows of the finished ``trials.csv`` that belongs to these settings, in its order.

    Raises:
        BadInput: it is not there yet, is damaged, or cannot be read.
    """
    path = folder / TRIALS
    try:
        with open_regular(path) as file:
            rows, _ = read_rows(file, settings, str(path))
    except FileNotFoundError:
        rows = []
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    if len(rows) < (total := count_of(settings)):
        raise BadInput(
            f"{folder}: its {kind} is not finished, it has {len(rows)} of {total} trials; "
            f"repeat its `wayfarer {command}` and add --resume to finish it first"
        )
    return in_table_order(rows, settings)
