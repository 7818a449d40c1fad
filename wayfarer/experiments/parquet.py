"""Copies a table of trials into a Parquet file, block by block, so that memory does not grow with the table.

pyarrow is imported here only, and only where a file is written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO

import pyarrow as pa
from pyarrow import csv, parquet

from wayfarer.experiments.rows import DECIMALS, TEXT_COLUMNS, TrialRow

ARROW = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}


def copy_as_parquet(table: BinaryIO, copy: BinaryIO, swept: Sequence[Mapping[str, Any]]) -> None:
    """Write an open ``trials.csv`` as Parquet; ``swept`` has the swept values at each point, for their types.

    Raises:
        OSError: the file cannot be written.
    """
    own = {name: str if name in TEXT_COLUMNS else float if name in DECIMALS else int for name in TrialRow._fields}
    types = own | {key: _common_type({type(values[key]) for values in swept}) for key in swept[0]}
    options = csv.ConvertOptions(column_types={name: ARROW[kind] for name, kind in types.items()}, null_values=[""])
    path = f"/proc/self/fd/{table.fileno()}"  # Arrow reads it by name, and makes no Python object of each block
    with csv.open_csv(path, convert_options=options) as rows, parquet.ParquetWriter(copy, rows.schema) as file:
        for batch in rows:
            file.write_batch(batch)


def _common_type(kinds: set[type]) -> type:
    if kinds == {int, float}:
        return float
    return kinds.pop() if len(kinds) == 1 else str
