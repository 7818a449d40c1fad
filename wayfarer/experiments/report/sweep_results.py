"""Reads the folder of a finished sweep: what was swept, and the rows of each point."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PlainValidator, model_validator

from wayfarer.experiments.measures import MEASURES, Estimate, Measure, difference, estimate
from wayfarer.experiments.report.load_results import read_settings, read_trials, recorded
from wayfarer.experiments.results_folder import SWEEP_SETTINGS
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.settings import MOST_DIGITS, MOST_TRIALS, Value
from wayfarer.experiments.sweep import MOST_AXES
from wayfarer.experiments.tables import SWEEP_COLUMNS, layouts_of_points


def _drawable(value: Value) -> Value:
    if isinstance(value, int | float) and not abs(value) < 10 ** (MOST_DIGITS + 1):
        raise ValueError(f"expected a number below 1e{MOST_DIGITS + 1}")
    return value


Drawable = Annotated[Value, AfterValidator(_drawable)]
if TYPE_CHECKING:
    from wayfarer.experiments.campaign import Campaign

    Recorded = Campaign
else:
    Recorded = Annotated[Any, PlainValidator(recorded)]


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
    campaign: Recorded

    @model_validator(mode="after")
    def _can_be_run(self) -> Self:
        campaign = self.campaign
        count = math.prod(len(axis.values) for axis in self.axes) * len(campaign.algorithms) * campaign.trials
        if count > MOST_TRIALS:
            raise ValueError(f"{count:,} trials, allowed are {MOST_TRIALS:,}")
        return self

    def settings(self) -> dict[str, Any]:
        """Return them as ``sweep.json`` has them."""
        return {"axes": [axis.model_dump() for axis in self.axes], "campaign": self.campaign.settings()}


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
    def algorithms(self) -> Sequence[str]:
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
        """The measures of a sweep that some point has: SPL needs shortest paths, some things never happen."""
        found = {each: self.estimates[each.name].values() for each in SWEEP_COLUMNS}
        return [
            MEASURES[each.name]
            for each, estimates in found.items()
            if any(one and (one.value or each.when != "if_any") for one in estimates)
        ]

    @cached_property
    def estimates(self) -> dict[str, dict[tuple[int, str], Estimate | None]]:
        """Each measure of a sweep at each point, of each algorithm."""
        return {
            each.name: {cell: estimate(rows, MEASURES[each.name]) for cell, rows in self.cells.items()}
            for each in SWEEP_COLUMNS
        }

    def change(self, point: int, algorithm: str) -> Estimate | None:
        """Return the difference in SPL to the same trials without a sweep; None if these met other layouts."""
        layouts = layouts_of_points(self.settings.settings())
        if self.now in {None, point} or layouts[point] != layouts[self.now or 0]:
            return None
        return difference(self.cells[point, algorithm], self.cells[self.now or 0, algorithm], MEASURES["spl"])

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
    settings = read_settings(folder / SWEEP_SETTINGS, SweepSettings.model_validate, "sweep")
    return SweepResults(settings, read_trials(folder, settings.settings(), "sweep", "sweep"))
