"""One trial as a row of ``trials.csv``.

A row holds exactly what its line of text holds: numbers are rounded when the row is made, so figures computed
from rows are the figures that anyone gets from the file, and a row that was read back writes the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from wayfarer.config.messages import shown
from wayfarer.errors import BadInput
from wayfarer.experiments.outcome import OUTCOMES, SUCCESSES
from wayfarer.experiments.settings import NOTHING
from wayfarer.fieldlog.wording import plural

if TYPE_CHECKING:
    from wayfarer.experiments.trial import TrialResult

TEXT_COLUMNS = ("algorithm", "outcome")
DECIMALS: Mapping[str, int] = {
    "path_m": 3, "reverse_m": 3, "time_s": 3, "shortest_path_m": 3, "spl": 4,
}  # fmt: skip
BELOW = 2**63  # what no number reaches: a whole one fits a column of a table, and any can be added up


class TrialRow(NamedTuple):
    """What is kept of one trial; None if a value is not known, as in a trial that ended in a fault.

    ``interventions`` are counted at sites only: of a rover that has ``overturned``, and of one that is ``off_wheels``.
    ``drawn`` has the values of the keys that were drawn for the trial, each of them a column. ``point`` has a column in
    the table of a sweep only.
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
    drawn: Mapping[str, float] = NOTHING
    point: int = 0

    def cells(self) -> dict[str, Any]:
        """Return the value of each column, those of what was drawn among them."""
        return {**self._asdict(), **self.drawn}

    @property
    def key(self) -> tuple[str, int, int]:
        """Algorithm, trial and point, which name a row within its campaign or sweep."""
        return self.algorithm, self.trial, self.point

    @property
    def counted_spl(self) -> float | None:
        """SPL as it counts in a mean: 0 for a failure; None if the shortest path is not known."""
        return None if self.shortest_path_m is None else self.spl or 0.0

    @property
    def escape_path_m(self) -> float | None:
        """Path as it counts in a mean: that of a success; None for a failure."""
        return self.path_m if self.outcome in SUCCESSES else None

    @property
    def escape_s(self) -> float | None:
        """Time as it counts in a mean of escapes: that of a success; None for a failure."""
        return self.time_s if self.outcome in SUCCESSES else None


FIELDS = frozenset(TrialRow._fields)
COLUMNS = tuple(name for name in TrialRow._fields if name not in {"drawn", "point"})


def row_of(result: TrialResult) -> TrialRow:
    """Return a trial's result as its row."""
    values = result._asdict()
    del values["ticks"]
    return TrialRow(**{name: _kept(name, value) for name, value in values.items()})


def rounded_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return these values as JSON and tables of results have them: floats with four decimals."""
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in values.items()}


def csv_line(columns: Sequence[str], row: TrialRow | None = None, swept: Mapping[str, Any] = NOTHING) -> str:
    """Return these columns of a row as a line of CSV, of which ``swept`` are not its own; without a row their names."""
    if row is None:
        return ",".join(columns) + "\n"
    values = row.cells()
    cells = (str(swept[name]) if name in swept else _text(name, values[name]) for name in columns)
    return ",".join(cells) + "\n"


def parse_row(line: bytes, columns: tuple[str, ...], where: str, swept: Mapping[str, Any] = NOTHING) -> TrialRow:
    """Return the row that ``csv_line`` wrote; what is in ``swept`` is left out.

    Raises:
        BadInput: the line is no such row; the text names ``where``.
    """
    try:
        texts = line.decode().rstrip("\n").split(",")
        if len(texts) != len(columns):
            raise ValueError(f"it has {plural(len(texts), 'cell')} for {plural(len(columns), 'column')}")
        cells = dict(zip(columns, texts, strict=True))
        others = [name for name in columns if name not in FIELDS and name not in swept]
        drawn = {name: _drawn_value(name, cells.pop(name)) for name in others}
        row = TrialRow(**{name: _value(name, text) for name, text in cells.items() if name in FIELDS}, drawn=drawn)
        if row.outcome not in OUTCOMES:
            raise ValueError(f"unknown outcome {shown(row.outcome)}")
    except ValueError as error:
        raise BadInput(f"{where} is not a row of a campaign ({error}); remove the line or the folder") from error
    return row


def _kept(name: str, value: Any) -> Any:
    if value is None or name not in DECIMALS:
        return value
    return round(value, DECIMALS[name]) + 0.0 if math.isfinite(value) else None  # + 0.0 turns -0.0 into 0.0


def _text(name: str, value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.{DECIMALS[name]}f}" if name in DECIMALS else f"{value:.6g}"
    return "" if value is None else str(value)


def _drawn_value(name: str, text: str) -> float:
    try:
        value = int(text) if text.removeprefix("-").isdecimal() else float(text)
    except ValueError:
        value = math.nan
    if not abs(value) < BELOW:
        raise ValueError(f"{name} is {shown(text)}")
    return value


def _value(name: str, text: str) -> Any:
    if name in TEXT_COLUMNS:
        return text
    if not text and TrialRow._field_defaults.get(name, 0) is None:
        return None
    try:
        value = float(text) if name in DECIMALS else int(text)
    except ValueError:
        value = math.nan
    if not 0 <= value < BELOW:
        raise ValueError(f"{name} is {shown(text)}")
    return value
