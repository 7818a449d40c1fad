"""Parquet: the rows of the CSV table, with types that do not depend on the run."""

from __future__ import annotations

import csv
import io
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from pyarrow import parquet

from tests.views.text.records import BEGAN_WALL_S, HEADER, SAMPLE_LOGS, drive, event, outcome, record, tick, write
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.schema import Record
from wayfarer.views.export.export import ExportFormat, export
from wayfarer.views.export.tables import COLUMNS, cell

(SAMPLE,) = SAMPLE_LOGS.glob("0*")


def table(folder: Path, *records: Record) -> pa.Table:
    out = folder / "run.parquet"
    assert export(write(folder / "run", [HEADER, *records]), ExportFormat.parquet, out, overwrite=True) == Damage()
    return parquet.read_table(out)


def test_rows_and_values_are_those_of_the_csv_table(tmp_path: Path) -> None:
    text = io.StringIO()
    ExportFormat.csv.write(SAMPLE, text)
    export(SAMPLE, ExportFormat.parquet, tmp_path / "run.parquet", overwrite=False)
    found = parquet.read_table(tmp_path / "run.parquet")
    rows = list(csv.DictReader(io.StringIO(text.getvalue())))
    assert set(found.column_names) == set(rows[0])
    for name in found.column_names:
        same = float if found.schema.field(name).type == pa.float64() else str
        values = [cell(value) for value in found[name].to_pylist()]
        assert [same(value) if value else value for value in values] == [
            same(row[name]) if row[name] else row[name] for row in rows
        ]


@pytest.mark.parametrize(
    ("name", "kind", "value"),
    [
        ("elapsed_s", pa.float64(), 1.0),
        ("n", pa.int64(), 1),
        ("t_wall", pa.timestamp("us", tz="UTC"), datetime.fromtimestamp(BEGAN_WALL_S + 1, UTC)),
        ("phase", pa.string(), "follow"),
        ("anomalies", pa.string(), "nose_up; touched"),
        ("motion_signed", pa.bool_(), True),
        ("motion_forward_m", pa.float64(), 1.0),
        ("board_faults", pa.string(), "too hot"),
        ("computer_log_dropped", pa.int64(), 3),
        ("truth_x_m", pa.float64(), None),
        ("event", pa.string(), "Held by an operator"),
        ("reckoned_north_m", pa.float64(), 1.0),
        ("episodes", pa.float64(), 2.0),
    ],
)
def test_column_that_every_table_has_is_of_one_type(tmp_path: Path, name: str, kind: pa.DataType, value: Any) -> None:
    moved = {"t_s": 101.0, "forward_m": 1, "right_m": 0.0, "quality": 1.0, "signed": True}
    told = table(
        tmp_path,
        record("board", 0.5, battery_v=None, faults=["too hot"]),
        record("computer", 0.5, log_dropped=3),
        event("hold", 0.6),
        tick(1.0, n=1, anomalies=["nose_up", "touched"], motion=moved, episodes=2),
    )
    assert told.schema.field(name).type == kind
    assert told[name].to_pylist() == [value]
    bare = table(tmp_path / "bare", tick(0.0, episodes=None))
    assert bare.schema.field(name).type == kind
    assert tuple(bare.column_names) == tuple(COLUMNS)


def test_another_algorithms_memory_has_the_type_of_its_values(tmp_path: Path) -> None:
    told = table(
        tmp_path,
        tick(0.0, mood="=good", speed=1, lost=None, side="left", sure=True, odd=1, board_battery_v="full"),
        tick(1.0, mood="bad", speed=1.5, lost=None, side=1, sure=False, odd=[1]),
        outcome(1.0),
    )
    assert told["mood"].to_pylist() == ["=good", "bad", None], "no spreadsheet opens it"
    assert told["speed"].to_pylist() == [1.0, 1.5, None]
    assert told["side"].to_pylist() == ["left", "1", None]
    assert told["sure"].to_pylist() == [True, False, None]
    assert told["odd"].to_pylist() == ["1", "1", None]
    assert (told["lost"].type, told["lost"].null_count) == (pa.float64(), 3)
    assert told["board_battery_v"].null_count == 3, "a name that the log uses for something else"


def test_long_run_is_written_in_blocks_and_the_same_log_gives_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wayfarer.views.export.parquet.BLOCK_ROWS", 100)
    ticks = drive(0.0, 6.0)
    assert table(tmp_path, *ticks).num_rows == len(ticks)
    written = (tmp_path / "run.parquet").read_bytes()
    assert parquet.ParquetFile(tmp_path / "run.parquet").num_row_groups == 2
    export(tmp_path / "run", ExportFormat.parquet, tmp_path / "again.parquet", overwrite=False)
    assert (tmp_path / "again.parquet").read_bytes() == written
