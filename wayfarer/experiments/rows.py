"""One trial as a row of ``trials.csv``.

A row holds exactly what its line of text holds: numbers are rounded when the row is made, so figures computed
from rows are the figures that anyone gets from the file, and a row that was read back writes the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from wayfarer.errors import BadInput

if TYPE_CHECKING:
    from wayfarer.experiments.trial import TrialResult

SUCCESSES = ("escaped", "left_bounds")  # paper, section IV-B: leaving by another edge counts as an escape
OUTCOMES = (*SUCCESSES, "entrapped", "tipped", "fault")

TEXT_COLUMNS = ("algorithm", "outcome")
KINDS = ("overturned", "off_wheels")  # of interventions; files of older versions do not have these columns
DECIMALS: Mapping[str, int] = {
    "path_m": 3, "reverse_m": 3, "time_s": 3, "shortest_path_m": 3, "spl": 4,
    "friction": 4, "roughness_m": 5, "torque_scale": 4,
}  # fmt: skip


class TrialRow(NamedTuple):
    """What is kept of one trial; None where a value is not known, as in a trial that ended in a fault.

    ``interventions`` are counted in scenarios only: of a rover that has ``overturned``, and of one that is
    ``off_wheels``. ``friction`` and what follows was drawn for a trial in MuJoCo. ``ticks``, the control ticks, has no
    column in ``trials.csv``.
    """

    trial: int
    algorithm: str
    forest: int
    noise: int
    seed: int
    outcome: str
    path_m: float | None = None
    reverse_m: float | None = None
    time_s: float | None = None
    anomalies: int | None = None
    episodes: int | None = None
    shortest_path_m: float | None = None
    spl: float | None = None
    interventions: int | None = None
    overturned: int | None = None
    off_wheels: int | None = None
    friction: float | None = None
    roughness_m: float | None = None
    torque_scale: float | None = None
    ticks: int | None = None

    @property
    def key(self) -> tuple[str, int]:
        """Algorithm and trial, which name a row within its campaign."""
        return self.algorithm, self.trial


TERRAIN = ("friction", "roughness_m", "torque_scale")
COLUMNS = tuple(name for name in TrialRow._fields if name not in (*TERRAIN, "ticks"))


def columns_of(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the columns of ``trials.csv`` in a campaign with these settings; in MuJoCo it has the terrain as well."""
    return (*COLUMNS, *TERRAIN) if settings.get("mujoco") else COLUMNS


def without_kinds(columns: tuple[str, ...]) -> tuple[str, ...]:
    """Return these columns as older versions had them, which counted interventions of all kinds together."""
    return tuple(name for name in columns if name not in KINDS)


def row_of(result: TrialResult) -> TrialRow:
    """Return a trial's result as its row."""
    return rounded_row(**result._asdict())


def rounded_row(**values: Any) -> TrialRow:
    """Return a row of these values."""
    return TrialRow(**{name: _kept(name, value) for name, value in values.items()})


def csv_line(columns: Sequence[str], row: TrialRow | None = None) -> str:
    """Return these columns of a row as a line of CSV; without a row their names."""
    return ",".join(columns if row is None else (_text(name, getattr(row, name)) for name in columns)) + "\n"


def parse_row(line: str, fields: tuple[str, ...], where: str) -> TrialRow:
    """Return the row that ``csv_line`` wrote.

    Raises:
        BadInput: the line is no such row; the text names ``where``.
    """
    texts = line.rstrip("\n").split(",")
    try:
        row = TrialRow(**{name: _value(name, text) for name, text in zip(fields, texts, strict=True)})
        if row.outcome not in OUTCOMES:
            raise ValueError(f"unknown outcome '{row.outcome}'")
    except ValueError as error:
        raise BadInput(f"{where} is not a row of a campaign ({error}); remove the line or the folder") from error
    return row


def _kept(name: str, value: Any) -> Any:
    if value is None or name not in DECIMALS:
        return value
    return round(value, DECIMALS[name]) + 0.0 if math.isfinite(value) else None  # + 0.0 turns -0.0 into 0.0


def _text(name: str, value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.{DECIMALS[name]}f}"
    return "" if value is None else str(value)


def _value(name: str, text: str) -> Any:
    if name in TEXT_COLUMNS:
        return text
    if not text and name in TrialRow._field_defaults:
        return None
    if name not in DECIMALS:
        return int(text)
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{name} is {text}")
    return value
