"""A log as a table for spreadsheets and plots: one row per control tick, with the events since the last one.

``csv_rows`` has flat columns with units. ``elapsed_s`` is the time by which all tools name a moment. Columns of
``tick`` keep their names, readings are flattened (``compass_heading_deg``), and what other records say is in the
row of the first tick after it, under the record's name (``board_battery_v``, ``truth_x_m``); events are joined in
``event``. Records after the last tick are in one more row.

A spreadsheet runs a cell that begins with ``=``, ``+``, ``-`` or ``@``: ``=HYPERLINK(...)`` sends what is in the table
to its author. Logs and scenarios may come from somebody else, so an apostrophe goes before such a text, as OWASP
recommends (https://owasp.org/www-community/attacks/CSV_Injection). A number, which may begin with a sign, is none.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, TextIO

import msgspec

from wayfarer.export import utc_stamp
from wayfarer.fieldlog.fields import escape_control_chars
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.record import (
    AnyRecord,
    Board,
    Compass,
    Computer,
    Contact,
    Event,
    FaultInjected,
    Fix,
    Motion,
    Outcome,
    Record,
    Tick,
    Truth,
    Wheels,
)
from wayfarer.fieldlog.wording import fault_text, outcome_text

STAMP = Record.__struct_fields__
BESIDE: Mapping[type[AnyRecord], str] = {Board: "board", Fix: "position", Computer: "computer", Truth: "truth"}
READINGS = {"compass": Compass, "motion": Motion, "contact": Contact, "wheels": Wheels}
NO_COLUMNS = {*STAMP, *READINGS, "manual", "memory"}
# What readings and other records say, under their names.
PART_COLUMNS = tuple(
    f"{name}_{key}"
    for name, kind in (*READINGS.items(), *((name, kind) for kind, name in BESIDE.items()))
    for key in kind.__struct_fields__
    if kind not in BESIDE or key not in STAMP
)
# Always there and in this order, so that the tables of two runs can be put below each other.
COLUMNS = (
    "elapsed_s", "t_s", "t_wall", "n", "event",
    "phase", "why", "anomalies", "heading_deg", "goal_heading_deg", "pitch_deg", "roll_deg", "travelled_m",
    "covered_m", "mode", "held", "mission_s", "mission_m", "north_m", "east_m", "path_m",
    "wanted_left", "wanted_right", "applied_left", "applied_right", "level", "cause",
    "counter_deg", "side", "turn_deg", "episodes", "blocked_turns", "turn_from_duty", "decision_t_s",
    *PART_COLUMNS,
)  # fmt: skip
_NUMBER = r"[+-](?:[0-9]+\.?[0-9]*(?:e[+-]?[0-9]+)?|inf)"
# Where the decimal separator is a comma, spreadsheets begin a cell after each semicolon, some after a tab. Full-width
# signs count too.
_FORMULA = re.compile(
    rf"(?:^|(?<=[;\t\r\n]))(?=[\t\r\n]|\s*[=+\-@\uff1d\uff0b\uff0d\uff20])(?!\s*{_NUMBER}\s*(?:;|\Z))"
)
Row = dict[str, Any]  # by column: a number, a flag, a text, a list of these, a time (``t_wall``), or None


def write_csv(run: Path, file: TextIO) -> Damage:
    """Write a run with a row for each tick, and return what of it could not be read."""
    reader = RunReader(run)
    further = further_columns(reader)
    csv.writer(file, lineterminator="\n").writerows(csv_rows(RunReader(run), further))
    return reader.damage


def csv_rows(records: Iterable[AnyRecord], further: Iterable[str] = ()) -> Iterator[list[str]]:
    """Give the titles, then a row for each tick; ``further`` are columns beyond those that every table has."""
    columns = dict.fromkeys([*COLUMNS, *further])
    yield [without_formulas(column) for column in columns]
    for row in table_rows(records):
        yield [_spreadsheet_cell(row.get(column)) for column in columns]


def further_columns(records: Iterable[AnyRecord]) -> list[str]:
    """Return the columns that only some tables have, as an algorithm's memory."""
    columns = dict.fromkeys(column for record in records for column in _columns_of(record))
    return [column for column in columns if column not in COLUMNS]


def table_rows(records: Iterable[AnyRecord]) -> Iterator[Row]:
    """Give a row for each tick, with the values as they are; a column that is not in a row has none.

    What is said between two ticks is in the row of the second; what no tick came after, in a last row.
    """
    stamp: Row = {}
    beside: Row = {}
    events: list[str] = []
    for record in records:
        stamp = {key: getattr(record, key) for key in STAMP} | {"t_wall": utc_stamp(record.t_wall)}
        match record:
            case Tick():
                yield {**_columns_of(record), **beside, **stamp, "event": "; ".join(events)}
                beside, events = {}, []
            case Event():
                events.append(record.text)
            case FaultInjected():
                events.append(fault_text(record))
            case Outcome():
                events.append(outcome_text(record))
            case _:
                beside |= _columns_of(record)
    if events or beside:
        yield {**beside, **stamp, "event": "; ".join(events)}


def _columns_of(record: AnyRecord) -> Row:
    """Return the columns of a record; none of one that is written in words, or that is in every part."""
    if isinstance(record, Tick):
        return _flat(record.memory | msgspec.structs.asdict(record), "")  # a key of the log's own counts
    if (name := BESIDE.get(type(record))) is None:
        return {}
    return _flat(msgspec.structs.asdict(record), f"{name}_")


def _flat(values: Mapping[str, Any], prefix: str) -> Row:
    """Return values by column, those of a reading under its name; none of a sensor that has not spoken."""
    row: Row = {}
    for key, value in values.items():
        if isinstance(value, msgspec.Struct):
            row |= {_title(f"{key}_", each): its for each, its in msgspec.structs.asdict(value).items()}
        elif isinstance(value, dict) and key != "memory":
            row |= {_title(f"{key}_", str(each)): its for each, its in value.items()}
        elif key not in NO_COLUMNS:
            row[_title(prefix, key)] = value
    return row


@lru_cache(maxsize=1000)
def _title(prefix: str, key: str) -> str:
    return escape_control_chars(prefix + key)


def cell(value: object) -> str:
    """Return a value as text; empty if there is none."""
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime):
        return value.isoformat(timespec="microseconds").replace("+00:00", "Z")
    return escape_control_chars("; ".join(map(str, value)) if isinstance(value, list | tuple) else str(value))


def _spreadsheet_cell(value: object) -> str:
    text = cell(value)
    return without_formulas(text) if isinstance(value, str | list | tuple) else text


@lru_cache(maxsize=1000)
def without_formulas(text: str) -> str:
    """Return the text of a cell, or of a column's title, so that a spreadsheet shows it and runs nothing."""
    return _FORMULA.sub("'", text)
