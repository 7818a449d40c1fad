"""Lines of a log: what each kind of record may hold, and the checksum, which tells whether a line was changed.

A line is one JSON object. Its last key is ``crc``: the CRC-32 of all bytes before that key, eight hexadecimal digits. A
log of schema 2 has none, and its lines are read without.

What a record may hold follows from the class of its kind. What an algorithm remembers is in none of the tables: a third
party's may be anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeGuard
from zlib import crc32

import orjson

from wayfarer.fieldlog.run_events import Ended, FaultInjected, Noted
from wayfarer.fieldlog.schema import ANY_NUMBER, FLAG, LIST, SCHEMA, STAMP, Record, Values, keys_of
from wayfarer.fieldlog.typed import Board, Computer, Fix, Header, Tick, Truth
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

LINE_BYTES = 1_000_000  # far more than any record: the header of a simulated forest has 20,000
CRC_KEY = b',"crc":"'
CRC_BYTES = len(CRC_KEY) + len(b'01234567"}')  # at the end of each line


def sealed(record: Record) -> bytes:
    """Return the line of a record, with its checksum and without its end of line; what is no JSON is told by its repr.

    Raises:
        TypeError: a key is no text, or a whole number has more than 64 bits.
    """
    body = orjson.dumps(record, default=repr)[:-1]  # no record is empty, so the key follows another
    return body + b',"crc":"%08x"}' % crc32(body)


def sealed_at(line: bytes, record: Record) -> bytes:
    """Return the line of a record at the time of the line that it stands before."""
    times = orjson.loads(line)
    return sealed(record | {key: times.get(key) for key in ("t_s", "t_wall")})


class LogLines:
    """Takes the lines of one log in their order, and tells which are records in their place.

    The log may begin in any line, so that each file, and the end of a file, can be read alone. ``missing`` counts the
    numbers of records that were skipped.
    """

    def __init__(self) -> None:
        self.missing = 0
        self._highest = 0
        self._has_checksums = False  # known from the first line that has one, or from a header of schema 3

    def take(self, line: bytes) -> Record | str:
        """Return the record of the next line, without its checksum, or which field of ``Damage`` counts the line."""
        record = self._parsed(line)
        if isinstance(record, str):
            return record
        if wrong_key(record) is not None:
            return "wrong"
        return record if self._goes_on(record) else "disordered"

    def _parsed(self, line: bytes) -> Record | str:
        """Return the record of a line that is as it was written; what is in it may be wrong."""
        if b"\0" in line:
            return "nul"
        if not line.endswith(b"\n"):
            return "oversized" if len(line) >= LINE_BYTES else "torn"
        body, end = line[: -CRC_BYTES - 1], line[-CRC_BYTES - 1 :]
        has_checksum = end.startswith(CRC_KEY)
        if has_checksum and end != b'%b%08x"}\n' % (CRC_KEY, crc32(body)):
            return "changed"
        try:
            record = orjson.loads(line)
        except ValueError:
            record = None
        if not is_record(record):
            return "garbled"
        self._has_checksums = self._has_checksums or has_checksum or needs_checksums(record)
        if has_checksum:
            del record["crc"]
        elif self._has_checksums:  # the key itself was damaged
            return "changed"
        return record

    def _goes_on(self, record: Record) -> bool:
        """Return whether a record has a larger number than all before it: else it is there twice, or was moved.

        Headers and ``log_gap`` have no number: the files are divided, and lose lines, where no number is known.
        """
        number = record.get("n")
        if number is None:
            return True
        if number <= self._highest:
            return False
        self.missing += number - self._highest - 1
        self._highest = number
        return True


def is_record(value: object) -> TypeGuard[Record]:
    """Return whether a line's JSON is a record of a known kind with a time; what else is in it may still be wrong."""
    return isinstance(value, dict) and value.get("record") in KINDS and value.get("t_s") is not None


def is_newer(header: Record) -> bool:
    """Return whether a header says that a newer wayfarer has written the log."""
    return bool((header.get("schema") or 0) > SCHEMA)


def needs_checksums(record: Record) -> bool:
    """Return whether a record is a header which says that each line of its log has a checksum."""
    return record["record"] == "run" and record.get("schema") == SCHEMA


def wrong_key(record: Record) -> str | None:
    """Return the first key of a record whose value cannot be, None if all can."""
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
