"""Reads the folder of a finished sweep: what was swept, and the rows of each point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, product
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from wayfarer.experiments.report.load_results import CampaignSettings, read_settings, read_trials
from wayfarer.experiments.results_folder import SWEEP_SETTINGS
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.statistics import MEASURES, Measure
from wayfarer.experiments.sweep import MOST_AXES, MOST_DIGITS, MOST_TRIALS, Value


def _drawable(value: Value) -> Value:
    if isinstance(value, int | float) and not abs(value) < 10 ** (MOST_DIGITS + 1):
        raise ValueError(f"expected a number below 1e{MOST_DIGITS + 1}")
    return value


Drawable = Annotated[Value, AfterValidator(_drawable)]


class SweptAxis(BaseModel):
    """A key, its values, and the value that the campaign had if it was not swept."""

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
    def measures(self) -> list[Measure]:
        """The measures that some point has; SPL needs shortest paths."""
        return [measure for measure in MEASURES if any(measure.of(rows) for rows in self.cells.values())]

    @property
    def has_spl(self) -> bool:
        """Return whether shortest paths are known."""
        return any(measure.name == "spl" for measure in self.measures)

    @cached_property
    def now(self) -> int | None:
        """The point that is the campaign as it is without a sweep, None if no point is."""
        values = tuple(axis.now for axis in self.axes)
        return next((number for number, point in enumerate(self.points) if point == values), None)


def is_sweep(folder: Path) -> bool:
    """Return whether a folder is a sweep's."""
    return (folder / SWEEP_SETTINGS).is_file()


def read_sweep(folder: Path) -> SweepResults:
    """Read the folder of a finished sweep.

    Raises:
        BadInput: the sweep is not finished, or its folder is damaged; the text says what to do.
    """
    settings = read_settings(folder / SWEEP_SETTINGS, SweepSettings, "sweep")
    return SweepResults(settings, read_trials(folder, settings, "sweep", "sweep"))
