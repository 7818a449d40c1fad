"""A run as a table of Arrow: the rows and columns of the CSV table, with types.

Imported only where a table is made: pyarrow is large. A column that every table has is of the same type in
every run, so that runs can be read together. What an algorithm remembers are numbers, unless a run holds other values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa

from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.schema import Values
from wayfarer.views.export.tables import COLUMNS, cell, further_columns, table_rows

BLOCK_ROWS = 10_000  # that are in memory at once: 500 s of ticks at 20 Hz
INT64 = range(-(2**63), 2**63)
FLAG, WHOLE, REAL, WORDS = pa.bool_(), pa.int64(), pa.float64(), pa.string()
TIME = pa.timestamp("us", tz="UTC")


def read_table(run: Path) -> pa.Table:
    """Return a run as a table.

    Raises:
        BadInput: the run cannot be read.
    """
    columns = _columns(further_columns(RunReader(run)))
    return pa.Table.from_batches(_batches(run, columns), pa.schema(columns))


def _batches(run: Path, columns: Mapping[str, pa.DataType]) -> Iterator[pa.RecordBatch]:
    schema, rows = pa.schema(columns), table_rows(RunReader(run))
    while block := list(islice(rows, BLOCK_ROWS)):
        values = {name: [_held(kind, row.get(name)) for row in block] for name, kind in columns.items()}
        yield pa.RecordBatch.from_pydict(values, schema)


def _held(kind: pa.DataType, value: Any) -> Any:
    """Return a value as a column of a type holds it; None for one that is no such thing."""
    if value is None:
        return None
    if kind is WORDS:
        return cell(value)
    if kind is TIME:
        return value
    if kind is REAL:
        return float(value) if type(value) in {int, float} else None
    if kind is FLAG:
        return value if type(value) is bool else None
    return value if type(value) is int and value in INT64 else None


def _columns(further: Mapping[str, set[type]]) -> dict[str, pa.DataType]:
    """Return the columns of a table with their types: those of the log's schema, or what stands in the log."""
    known = {name: _of(values) if values else _holding(further.get(name, set())) for name, values in COLUMNS.items()}
    known["t_wall"] = TIME
    return known | {name: _holding(types) for name, types in further.items() if name not in COLUMNS}


def _holding(types: set[type]) -> pa.DataType:
    kinds = types - {type(None)}
    if kinds <= {int, float}:
        return REAL
    return FLAG if kinds == {bool} else WORDS


def _of(values: Values) -> pa.DataType:
    if bool in values.types:
        return FLAG
    if str in values.types or list in values.types:
        return WORDS
    return REAL if float in values.types else WHOLE
