"""Rows of a table, as plain Python or as a frame of another library."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.util import find_spec
from itertools import islice
from typing import TYPE_CHECKING, Any

from wayfarer.errors import MissingPackage
from wayfarer.extras import require

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow

BLOCK_ROWS = 10_000  # that are Python objects at once


class Rows(Iterable[dict[str, Any]]):
    """The rows of a table; iterate over them, or take them as a frame.

    Iterating gives each row as a dict and needs no further package. The frames are ordinary ones: a ``DataFrame`` of
    pandas or Polars, or a ``Table`` of Arrow, which DuckDB and others read as well. All of them are made through Arrow,
    which is in the extra ``sim``. Whatever takes an Arrow stream also takes the rows themselves.

    >>> rows = open_run(1, log_dir="field_logs").events
    >>> next(iter(rows))["name"]
    'opened'
    >>> rows.to_pandas().columns.tolist() == rows.to_polars().columns == rows.to_arrow().column_names
    True
    """

    def __init__(
        self, read: Callable[[], Iterable[Mapping[str, Any]]], make_table: Callable[[], pyarrow.Table]
    ) -> None:
        self._read = read
        self._make_table = make_table

    def __repr__(self) -> str:
        return "<Rows: iterate over them, or take a frame with to_pandas(), to_polars() or to_arrow()>"

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return map(dict, self._read())

    def to_arrow(self) -> pyarrow.Table:
        """Return the rows as a ``pyarrow.Table``.

        Raises:
            MissingPackage: pyarrow is not installed.
        """
        require("a table")
        return self._make_table()

    def to_pandas(self) -> pandas.DataFrame:
        """Return the rows as a ``pandas.DataFrame``.

        Raises:
            MissingPackage: pandas or pyarrow is not installed.
        """
        _require("pandas")
        return self.to_arrow().to_pandas()

    def to_polars(self) -> polars.DataFrame:
        """Return the rows as a ``polars.DataFrame``.

        Raises:
            MissingPackage: Polars or pyarrow is not installed.
        """
        _require("polars")
        import polars

        frame = polars.from_arrow(self.to_arrow())
        assert isinstance(frame, polars.DataFrame)  # of an array it would be a series
        return frame

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.to_arrow().__arrow_c_stream__(requested_schema)


def _require(package: str) -> None:
    """Refuse to go on without a package that no extra of wayfarer has."""
    if find_spec(package) is None:
        raise MissingPackage(
            f"to_{package}() needs {package}, which is not installed: pip install {package}; or use to_arrow()"
        )


def typed_rows(columns: Mapping[str, type], read: Callable[[], Iterable[Mapping[str, Any]]]) -> Rows:
    """Return rows with these columns, whose values are None or of these types."""

    def make_table() -> pyarrow.Table:
        from pyarrow import RecordBatch, Table

        from wayfarer.views.export.arrow import arrow_schema

        schema, rows = arrow_schema(columns), iter(read())
        blocks = iter(lambda: list(islice(rows, BLOCK_ROWS)), [])
        return Table.from_batches((RecordBatch.from_pylist(block, schema) for block in blocks), schema)

    return Rows(read, make_table)
