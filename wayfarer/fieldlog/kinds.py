"""All kinds of records by their names: the tables of their keys, and what is wrong with a record. Pure.

What an algorithm remembers is in none of the tables: a third party's may be anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wayfarer.fieldlog.header import Header
from wayfarer.fieldlog.run_events import Ended, FaultInjected, Noted
from wayfarer.fieldlog.schema import ANY_NUMBER, FLAG, LIST, SCHEMA, STAMP, Record, Values, keys_of
from wayfarer.fieldlog.typed import Board, Computer, Fix, Tick, Truth
from wayfarer.hal import CompassReading, ContactReading, MotionReading

KEYS: Mapping[str, Mapping[str, Values]] = {
    "run": keys_of(Header), "tick": keys_of(Tick), "event": keys_of(Noted), "position": keys_of(Fix),
    "board": keys_of(Board), "computer": keys_of(Computer), "truth": keys_of(Truth), "fault": keys_of(FaultInjected),
    "outcome": keys_of(Ended),
}  # fmt: skip
KINDS = tuple(KEYS)
NO_NUMBERS = {"signed": FLAG, "sides": LIST}
READINGS: Mapping[str, Mapping[str, Values]] = {
    name: {key: NO_NUMBERS.get(key, ANY_NUMBER) for key in reading._fields}
    for name, reading in (("compass", CompassReading), ("motion", MotionReading), ("contact", ContactReading))
}

Rows = tuple[tuple[str, tuple[type, ...], float | None, float | None], ...]


def _rows(keys: Mapping[str, Values]) -> Rows:
    """Return a table as what is quickest to go through: an hour has 72,000 ticks of 30 values."""
    return tuple((key, *values) for key, values in keys.items())


_OF_KIND = {kind: _rows({**STAMP, **keys}) for kind, keys in KEYS.items()}
_OF_READING = {name: _rows(keys) for name, keys in READINGS.items()}


def is_record(value: object) -> bool:
    """Return whether a line's JSON is a record of a known kind with a time; what else is in it may still be wrong."""
    return isinstance(value, dict) and value.get("record") in KINDS and value.get("t_s") is not None


def is_newer(header: Record) -> bool:
    """Return whether a header says that a newer wayfarer has written the log."""
    return bool((header.get("schema") or 0) > SCHEMA)


def needs_checksums(record: Record) -> bool:
    """Return whether a record is a header which says that each line of its log has a checksum."""
    return record["record"] == "run" and record.get("schema") == SCHEMA


def wrong_key(record: Record) -> str | None:
    """Return the first key of a record whose value cannot be, None where all can."""
    kind = record["record"]
    if kind == "run" and record.get("schema") is None:
        return "schema"
    if (unknown := next((key for key in STAMP if record.get(key, 0) is None), None)) is not None:
        return unknown
    wrong = _wrong(record, _OF_KIND[kind])
    if wrong is None and kind == "tick":
        for name, rows in _OF_READING.items():
            reading = record.get(name)
            if reading is not None and (key := _wrong(reading, rows)) is not None:
                return f"{name}.{key}"
    return wrong


def _wrong(values: Mapping[str, Any], rows: Rows) -> str | None:
    get = values.get
    for key, types, least, most in rows:
        value = get(key)
        if value is not None and (type(value) not in types or (most is not None and not least <= value <= most)):
            return key
    return None
