"""Arrow's names for the types that columns of tables have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # it is large: imported only where a table is made
    import pyarrow


def arrow_schema(columns: Mapping[str, type]) -> pyarrow.Schema:
    """Return the schema of a table with these columns, each of bool, int, float or str."""
    import pyarrow as pa

    arrow = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}
    return pa.schema([(name, arrow[kind]) for name, kind in columns.items()])
