"""Reads the folder of a finished campaign: settings, rows, and the campaign itself if it can be rebuilt."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator

from wayfarer.config.messages import key_and_problem
from wayfarer.config.registry import refuse_code
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign, ForestFile, read_forest_file
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
from wayfarer.experiments.sweep import MOST_TRIALS
from wayfarer.experiments.tables import campaign_table
from wayfarer.files import open_regular, read_regular
from wayfarer.logview.terminal_table import TextTable
from wayfarer.simhal.faults.kinds import parse_fault
from wayfarer.simhal.mujoco.terrain import terrains_of
from wayfarer.simhal.world.physics import GroundName, Physics
from wayfarer.simhal.world.slope import slopes_of

T = TypeVar("T")
ModelT = TypeVar("ModelT", bound=BaseModel)
Bounds = dict[str, list[float]]  # the least and the most of what is drawn for each trial, by its name


def _taken_by(read: Callable[[T], object]) -> AfterValidator:
    """Return the check that ``read`` can make something of a value."""

    def check(value: T) -> T:
        read(value)
        return value

    return AfterValidator(check)


class ForestsSettings(BaseModel):
    """Which file the forests came from: its name, and the checksum of its content."""

    file: str
    blake2b: str


class CampaignSettings(BaseModel):
    """``campaign.json``, as ``Campaign.settings`` wrote it; the rover is read where trials are to be run again."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    version: str
    algorithms: list[str] = Field(min_length=1)
    trials: int = Field(ge=1, le=MOST_TRIALS)  # of each algorithm, as the option allows
    seed: int = Field(ge=0)
    slip_mean_m: float = Field(gt=0)
    budget_m: float = Field(gt=0)
    spl: bool
    depth: Literal["device", "bus"]
    scenario: str | None
    forests: ForestsSettings | None
    rover: dict[str, Any]
    mujoco: Annotated[Bounds, _taken_by(terrains_of)] | None
    ground: GroundName
    slope: Annotated[Bounds, _taken_by(slopes_of)] | None
    sim: Physics
    faults: list[Annotated[str, _taken_by(parse_fault)]]

    @field_validator("algorithms")
    @classmethod
    def _are_names(cls, names: list[str]) -> list[str]:
        if len(set(names)) < len(names) or not all(map(str.isprintable, names)):
            raise ValueError("a name is there twice, or has characters that a terminal obeys")
        return names

    @field_validator("scenario")
    @classmethod
    def _is_a_site(cls, name: str | None) -> str | None:
        from wayfarer.simhal.world.sites import SITES

        if name is not None and name not in SITES:
            raise ValueError(f"no such site; there are {', '.join(SITES)}")
        return name


@dataclass(frozen=True)
class CampaignResults:
    """What a campaign's folder holds: ``rows`` are those of ``trials.csv``, complete and in its order."""

    folder: Path
    settings: CampaignSettings
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
        return reported(self.settings.model_dump(mode="json"))

    def table(self, *, full: bool) -> TextTable:
        """Return the table of the results, with the paper's figures; ``full`` as of ``campaign_table``."""
        return campaign_table(self.by_algorithm, self.reported, site=self.settings.scenario is not None, full=full)

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
        if not allow_code:
            refuse_code(*settings.algorithms, *_names(settings.rover))
        return Campaign(
            tuple(settings.algorithms),
            settings.trials,
            self._rover(),
            seed=settings.seed,
            slip_mean_m=settings.slip_mean_m,
            budget_m=settings.budget_m,
            spl=settings.spl,
            depth=settings.depth,
            scenario=settings.scenario,
            forests=self._forests(settings.forests) if settings.forests else None,
            terrains=terrains_of(settings.mujoco) if settings.mujoco else None,
            ground=settings.ground,
            physics=settings.sim,
            slopes=slopes_of(settings.slope) if settings.slope else None,
            faults=tuple(settings.faults),
        )

    def _rover(self) -> RoverConfig:
        try:
            return RoverConfig.model_validate_json(json.dumps(self.settings.rover), strict=True)
        except ValidationError:
            raise BadInput(f"this version does not understand the rover of version {self.settings.version}") from None

    def _forests(self, wanted: ForestsSettings) -> ForestFile:
        if not (self.folder / FORESTS).exists():
            raise BadInput(
                f"the folder has no copy of the campaign's forests; put {wanted.file} there as {FORESTS} "
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
    settings = read_settings(folder / SETTINGS, CampaignSettings, "campaign")
    return CampaignResults(folder, settings, read_trials(folder, settings, "campaign", "sim"))


def read_settings(path: Path, model: type[ModelT], kind: str) -> ModelT:
    """Return what a file such as ``campaign.json`` or ``sweep.json`` holds; ``kind`` is what errors call its owner.

    Raises:
        BadInput: it cannot be read, or no such settings are in it.
    """
    try:
        return model.model_validate_json(read_regular(path, MOST_BYTES))
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise BadInput(f"{path} is damaged: {key_and_problem(error)}; the {kind} must be run again") from None


def read_trials(folder: Path, model: BaseModel, kind: str, command: str) -> list[TrialRow]:
    """Return the rows of the finished ``trials.csv`` that belongs to these settings, in its order.

    Raises:
        BadInput: it is not there yet, is damaged, or cannot be read.
    """
    path, settings = folder / TRIALS, model.model_dump()
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
