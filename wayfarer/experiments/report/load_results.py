"""Reads the folder of a finished campaign or sweep: settings, rows, and a campaign itself if it can be rebuilt."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, product
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from wayfarer.config.messages import key_and_problem
from wayfarer.config.registry import refuse_code
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign, ForestFile, read_forest_file
from wayfarer.experiments.results_folder import (
    FORESTS,
    MOST_BYTES,
    PARTIAL,
    SETTINGS,
    SWEEP_SETTINGS,
    TRIALS,
    finished_trials,
)
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import AlgorithmSummary, summarise
from wayfarer.experiments.sweep import MOST_AXES, MOST_DIGITS, MOST_TRIALS, Value
from wayfarer.files.regular_file import read_regular
from wayfarer.simhal.mujoco.terrain import terrains_of
from wayfarer.simhal.world.physics import GroundName, Physics
from wayfarer.simhal.world.slope import slopes_of

ModelT = TypeVar("ModelT", bound=BaseModel)


def _drawable(value: Value) -> Value:
    if isinstance(value, int | float) and not abs(value) < 10 ** (MOST_DIGITS + 1):
        raise ValueError(f"expected a number below 1e{MOST_DIGITS + 1}")
    return value


Drawable = Annotated[Value, AfterValidator(_drawable)]


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
    mujoco: dict[str, list[float]] | None
    ground: GroundName
    slope: dict[str, list[float]] | None
    sim: Physics

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

    @field_validator("mujoco")
    @classmethod
    def _are_terrains(cls, bounds: dict[str, list[float]] | None) -> dict[str, list[float]] | None:
        if bounds is not None:
            terrains_of(bounds)
        return bounds

    @field_validator("slope")
    @classmethod
    def _are_slopes(cls, bounds: dict[str, list[float]] | None) -> dict[str, list[float]] | None:
        if bounds is not None:
            slopes_of(bounds)
        return bounds


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
    def summaries(self) -> dict[str, AlgorithmSummary]:
        """What the rows say of each algorithm."""
        return {name: summarise(name, rows) for name, rows in self.by_algorithm.items()}

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


class SweptAxis(BaseModel):
    """A key, its values, and the value that the campaign had where it was not swept."""

    model_config = ConfigDict(strict=True)

    key: str
    values: list[Drawable] = Field(min_length=1)
    now: Drawable | None

    @property
    def numeric(self) -> bool:
        """Return whether all values are numbers."""
        return not any(isinstance(value, str | bool) for value in self.values)


class SweepSettings(BaseModel):
    """``sweep.json``, as ``Sweep.settings`` wrote it."""

    axes: list[SweptAxis] = Field(min_length=1, max_length=MOST_AXES)
    campaign: CampaignSettings

    @model_validator(mode="after")
    def _can_be_run(self) -> Self:
        campaign = self.campaign
        count = math.prod(len(axis.values) for axis in self.axes) * len(campaign.algorithms) * campaign.trials
        if count > MOST_TRIALS:
            raise ValueError(f"{count:,} trials, allowed are {MOST_TRIALS:,}")
        return self


@dataclass(frozen=True)
class SweepResults:
    """What a sweep's folder holds: ``rows`` are those of ``trials.csv``, complete and in its order."""

    settings: SweepSettings
    rows: list[TrialRow]

    @property
    def axes(self) -> list[SweptAxis]:
        """What was swept."""
        return self.settings.axes

    @property
    def algorithms(self) -> list[str]:
        """Who decided, in the campaign's order."""
        return self.settings.campaign.algorithms

    @cached_property
    def points(self) -> list[tuple[Value, ...]]:
        """The values at each point."""
        return list(product(*(axis.values for axis in self.axes)))

    @cached_property
    def cells(self) -> dict[tuple[int, str], list[TrialRow]]:
        """The rows of each point and algorithm."""
        return {cell: list(rows) for cell, rows in groupby(self.rows, lambda row: (row.point, row.algorithm))}

    @cached_property
    def now(self) -> int | None:
        """The point that is the campaign as it is without a sweep, None where no point is."""
        values = tuple(axis.now for axis in self.axes)
        return next((number for number, point in enumerate(self.points) if point == values), None)


def is_sweep(folder: Path) -> bool:
    """Return whether a folder is a sweep's."""
    return (folder / SWEEP_SETTINGS).is_file()


def read_results(folder: Path) -> CampaignResults:
    """Read the folder of a finished campaign.

    Raises:
        BadInput: no such folder, no campaign in it, not finished, or damaged; the text says which, and what to do.
    """
    if not folder.is_dir():
        raise BadInput(f"{folder}: no such folder; give one that `wayfarer sim --out` has filled")
    if not (folder / SETTINGS).exists():
        raise BadInput(f"{folder} holds no campaign: {SETTINGS} is missing; give a folder of `wayfarer sim --out`")
    settings = _read_settings(folder / SETTINGS, CampaignSettings, "campaign")
    return CampaignResults(folder, settings, _read_trials(folder, settings, "campaign", "sim"))


def read_sweep(folder: Path) -> SweepResults:
    """Read the folder of a finished sweep.

    Raises:
        BadInput: the sweep is not finished, or its folder is damaged; the text says what to do.
    """
    settings = _read_settings(folder / SWEEP_SETTINGS, SweepSettings, "sweep")
    return SweepResults(settings, _read_trials(folder, settings, "sweep", "sweep"))


def _read_settings(path: Path, model: type[ModelT], kind: str) -> ModelT:
    try:
        return model.model_validate_json(read_regular(path, MOST_BYTES))
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        raise BadInput(f"{path} is damaged: {key_and_problem(error)}; the {kind} must be run again") from None


def _read_trials(folder: Path, model: BaseModel, kind: str, command: str) -> list[TrialRow]:
    path = folder / TRIALS
    if (folder / PARTIAL).exists() or not path.exists():
        raise BadInput(
            f"{folder}: its {kind} is not finished; repeat its `wayfarer {command}` and add --resume to finish it first"
        )
    try:
        with finished_trials(folder, model.model_dump()) as trials:
            return list(trials)
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
