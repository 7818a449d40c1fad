"""Reads the folder of a finished sweep."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from wayfarer.config.messages import most_telling
from wayfarer.errors import BadInput
from wayfarer.experiments.report.reading import Settings
from wayfarer.experiments.rows import COLUMNS, TrialRow
from wayfarer.experiments.sweep.axes import Value
from wayfarer.experiments.sweep.folder import SETTINGS, TRIALS, read_trials
from wayfarer.experiments.sweep.grid import MOST_AXES, PointTask
from wayfarer.experiments.sweep.measures import by_cell


class SweptAxis(BaseModel):
    """A key, its values, and the value that the campaign had where it was not swept."""

    model_config = ConfigDict(strict=True)

    key: str
    values: list[Value] = Field(min_length=1)
    now: Value | None

    @property
    def numeric(self) -> bool:
        """Tell whether all values are numbers."""
        return not any(isinstance(value, str | bool) for value in self.values)


class SweepSettings(BaseModel):
    """``sweep.json``, as ``Sweep.settings`` wrote it."""

    axes: list[SweptAxis] = Field(min_length=1, max_length=MOST_AXES)
    campaign: Settings


@dataclass(frozen=True)
class SweepResults:
    """What a sweep's folder holds: ``rows`` are those of ``trials.csv``, complete and in its order."""

    settings: SweepSettings
    rows: dict[PointTask, TrialRow]

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
        return by_cell(self.rows)

    @cached_property
    def now(self) -> int | None:
        """The point that is the campaign as it is without a sweep, None where no point is."""
        values = tuple(axis.now for axis in self.axes)
        return next((number for number, point in enumerate(self.points) if point == values), None)


def is_sweep(folder: Path) -> bool:
    """Tell whether a folder is a sweep's."""
    return (folder / SETTINGS).is_file()


def read_sweep(folder: Path) -> SweepResults:
    """Read the folder of a finished sweep.

    Raises:
        BadInput: the sweep is not finished, or its folder is damaged; the text says what to do.
    """
    path = folder / SETTINGS
    try:
        settings = SweepSettings.model_validate_json(path.read_bytes())
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        problem = most_telling(error)
        key = ".".join(map(str, problem["loc"])) or "the file"
        raise BadInput(f"{path} is damaged: {key}: {problem['msg']}; the sweep must be run again") from None
    if not (folder / TRIALS).exists():
        raise BadInput(
            f"{folder}: its sweep is not finished; repeat its `wayfarer sweep` and add --resume to finish it first"
        )
    results = SweepResults(settings, read_trials(folder / TRIALS, COLUMNS, len(settings.axes)))
    campaign, points = settings.campaign, range(len(results.points))
    expected = [
        PointTask(p, name, trial) for p in points for name in campaign.algorithms for trial in range(campaign.trials)
    ]
    if list(results.rows) != expected:
        raise BadInput(
            f"{folder / TRIALS} is damaged: it has not the {len(expected)} rows, one a trial, that the sweep wrote; "
            "run the sweep again into another folder"
        )
    return results
