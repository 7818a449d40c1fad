"""Writes Parquet files row by row; memory holds one row group, independent of the file's length.

pyarrow is imported here only, and only where a file is written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, Self, get_args, get_type_hints

import pyarrow as pa
from pyarrow import parquet

ROW_GROUP = 1000  # rows; waiting to be written they take a kilobyte each
ARROW = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}


def types_of(row: type[Any], names: Sequence[str]) -> dict[str, type]:
    """Return the type of each of these fields of a typed row; ``X | None`` counts as ``X``."""
    hints = get_type_hints(row)
    return {name: next((each for each in get_args(hints[name]) if each is not NoneType), hints[name]) for name in names}


class ParquetRows:
    """A Parquet file under a path, with these columns and their types (bool, int, float, str); None is no value.

    It is a context manager: the file is readable once that is left.

    Raises:
        OSError: the file cannot be written.
    """

    def __init__(self, path: Path, columns: Mapping[str, type]) -> None:
        self._schema = pa.schema([pa.field(name, ARROW[kind]) for name, kind in columns.items()])
        self._writer = parquet.ParquetWriter(path, self._schema)
        self._rows: list[Sequence[Any]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._flush()
        self._writer.close()

    def append(self, row: Sequence[Any]) -> None:
        """Add a row, its values in the order of the columns."""
        self._rows.append(row)
        if len(self._rows) == ROW_GROUP:
            self._flush()

    def _flush(self) -> None:
        if self._rows:
            by_column = zip(*self._rows, strict=True)
            columns = [pa.array(values, field.type) for values, field in zip(by_column, self._schema, strict=True)]
            self._writer.write_table(pa.Table.from_arrays(columns, schema=self._schema))
            self._rows = []
