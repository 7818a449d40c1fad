"""Reads a log back despite damage: power cuts, a full disk, a failing card.

Each line is judged alone, and what is wrong with it is counted. A line that was being written when the power went does
not parse, or is filled with NUL bytes; nothing after it is lost, because the next part and the next run have files of
their own. Memory does not grow with the log, nor with what is broken in it.
"""

from __future__ import annotations

import errno
import gzip
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, fields
from io import BufferedReader, FileIO
from itertools import islice
from pathlib import Path
from typing import IO, cast

import msgspec

from wayfarer import __version__
from wayfarer.errors import BadInput, NothingReadable
from wayfarer.fieldlog.fields import escape_document
from wayfarer.fieldlog.folders import no_run, parts_of
from wayfarer.fieldlog.record import KINDS, SCHEMA, AnyRecord, Header, decode
from wayfarer.files import open_regular

READ_BYTES = 262_144  # read from the disk at once
PART_BYTES = 4_000_000_000  # of a part are read, at most: twice what ``part_mb`` may be, and no hole of a terabyte
LINE_BYTES = 1_000_000  # far more than any record: the header of a simulated forest has 20,000
PACKED_BYTES = 200_000_000  # unpacked, to find the end of a part: a second of work
BROKEN_LINES = 20_000  # of a run are skipped, at most: a file of garbage is not read for hours
DEPTH = 100  # of a record: what is nested without an end cannot be shown or written again
FIRST_LINES = 16  # of a part are its beginning: if some of them are broken, the others still say when it was
CANNOT_BE_READ = (OSError, EOFError, zlib.error)  # the latter two: a packed file without its end, or a damaged one
GZIP = b"\x1f\x8b"  # begins what gzip has packed
BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # an editor may have put it there


@dataclass
class Damage:
    """What could not be read; its text says it to a person.

    ``torn`` lines are not JSON: they have no end, or hold NUL bytes. ``unknown`` ones have no known kind. In ``wrong``
    ones something cannot be, and ``first_wrong`` says what it was in the first of them. ``repeated`` ones have a number
    that does not grow. ``headless`` is 1 if the log does not begin with its header. ``unreadable`` parts could not be
    read to their end. ``missing`` records are not there, by their numbers: those in skipped lines, those that the disk
    could not take, and those in parts that were deleted.
    """

    torn: int = 0
    unknown: int = 0
    wrong: int = 0
    repeated: int = 0
    headless: int = 0
    unreadable: int = 0
    missing: int = 0
    first_wrong: str = ""

    @property
    def lines(self) -> int:
        """How many lines were skipped."""
        return self.torn + self.unknown + self.wrong + self.repeated

    def __bool__(self) -> bool:
        return self != Damage()

    def __str__(self) -> str:
        told = []
        for field in fields(self)[:-1]:
            count, (one, many) = getattr(self, field.name), SAID[field.name]
            if count:
                first = f" (the first: {self.first_wrong})" if field.name == "wrong" and self.first_wrong else ""
                told.append(f"1 {one}{first}" if count == 1 else f"{count} {many}{first}")
        return ", ".join(told) or "complete"


SAID = {
    "torn": ("line is torn", "lines are torn"),
    "unknown": ("record is of an unknown kind", "records are of an unknown kind"),
    "wrong": ("record holds an impossible value", "records hold impossible values"),
    "repeated": ("record is there twice or out of order", "records are there twice or out of order"),
    "headless": ("header is missing", "headers are missing"),
    "unreadable": ("part of the log cannot be read", "parts of the log cannot be read"),
    "missing": ("record is missing", "records are missing"),
}


class Lines:
    """Takes the lines of one log in their order; what is not a record in its place is counted in ``damage``.

    The log may begin in any line if it is ``whole`` no more, so that the end of a file can be read alone.
    """

    def __init__(self, *, whole: bool = False) -> None:
        self.damage = Damage()
        self._highest: int | None = 0 if whole else None
        self._ours = False

    def parse(self, line: bytes) -> AnyRecord | None:
        """Return the record of the next line, None if it is none in its place; a CR or a mark at its end is ignored.

        Raises:
            BadInput: it is the header of a log that another wayfarer has written, in another form.
        """
        begins = line.removeprefix(BYTE_ORDER_MARK)
        if hole := b"\0" in begins:  # which may end at the beginning of a line
            self.damage.torn += 1
            begins = begins.rpartition(b"\0")[2]
        if not begins.strip():
            return None
        try:
            record = decode(begins)
            brackets = begins.count(b"{") + begins.count(b"[")
            if brackets > DEPTH or b"\\" in begins or b"\x7f" in begins or not begins.isascii():
                record = _printable(record)
        except (ValueError, RecursionError) as error:
            self._count(begins, str(error), of_a_hole=hole)
            return None
        if isinstance(record, Header) and not self._is_ours(record.schema):
            return None
        return record if self._goes_on(record.n) else None

    def _count(self, line: bytes, error: str, *, of_a_hole: bool) -> None:
        """Count a line that is not a record: torn, or JSON of an unknown kind or with a value that cannot be."""
        try:
            said = msgspec.json.decode(line)
        except (ValueError, RecursionError):
            self.damage.torn += not of_a_hole
            return
        kind, schema = (said.get("record"), said.get("schema")) if isinstance(said, dict) else (None, None)
        if kind == "run" and isinstance(schema, int) and not self._is_ours(schema):
            return
        if isinstance(kind, str) and kind in KINDS:
            self._count_wrong(f"{kind}: {error}")
        else:
            self.damage.unknown += 1

    def _is_ours(self, schema: int) -> bool:
        """Return whether a header has the form that is read here; in a log that began so, another one is damage."""
        if schema == SCHEMA:
            self._ours = True
        elif self._ours:
            self._count_wrong(f"run: schema {schema}")
        else:
            raise BadInput(
                f"this log has schema {schema}, and wayfarer {__version__} reads {SCHEMA}: read it with the version "
                "that has written it, which its first line names"
            )
        return schema == SCHEMA

    def _count_wrong(self, what: str) -> None:
        self.damage.wrong += 1
        self.damage.first_wrong = self.damage.first_wrong or what

    def _goes_on(self, number: int) -> bool:
        """Return whether a record has a larger number than all before it: else it is there twice, or was moved."""
        if number == 0:  # a header
            return True
        highest = number - 1 if self._highest is None else self._highest
        if number <= highest:
            self.damage.repeated += 1
            return False
        self.damage.missing += number - highest - 1
        self._highest = number
        return True


def _printable(record: AnyRecord) -> AnyRecord:
    """Return a record in which no text can command a terminal.

    Raises:
        RecursionError: it is nested deeper than ``DEPTH``.
    """
    return msgspec.convert(escape_document(msgspec.to_builtins(record), DEPTH), type(record))


class RunReader:
    """Reads the records of one run in their order; ``damage`` is complete once all of them were read.

    Iterate it once. The header of a later part of the log is given as well, as another ``run`` record.

    Args:
        run: a run's folder, or one file of a log.
        beginnings: read only the first lines of each part; quick for any content.

    Raises:
        BadInput: the folder cannot be read, or there is no log in it; while iterating, another wayfarer has written it,
            in another form.
        NothingReadable: while iterating, there was no record that can be read.
    """

    def __init__(self, run: Path, *, beginnings: bool = False) -> None:
        self.run = run
        self.segments = log_segments(run)
        self._lines = Lines(whole=True)
        self._most_lines: int | None = FIRST_LINES if beginnings else None
        self._most_bytes = LINE_BYTES if beginnings else PART_BYTES
        self.damage = self._lines.damage

    def __iter__(self) -> Iterator[AnyRecord]:
        empty, skipped = True, 0
        for segment in self.segments:
            try:
                with open_log(segment) as file:
                    for line in islice(_lines(file, self._most_bytes), self._most_lines):
                        if (record := self._lines.parse(line)) is not None:
                            self.damage.headless |= empty and not isinstance(record, Header)
                            empty = False
                            yield record
                        elif (skipped := skipped + 1) > BROKEN_LINES:
                            raise OSError(errno.EFBIG, f"more than {BROKEN_LINES:,} of its lines are not records")
            except BadInput as error:
                raise BadInput(f"{segment}: {error}") from None
            except CANNOT_BE_READ as error:
                self.damage.unreadable += 1
                last = getattr(error, "strerror", None) or str(error)
        if empty:
            why = (
                last if self.damage.unreadable == len(self.segments) else self.damage if self.damage else "it is empty"
            )
            raise NothingReadable(f"{self.run}: nothing in this log can be read ({why})")


def first_record(run: Path) -> AnyRecord:
    """Return the first record of a run; quickly, with anything in its folder.

    Raises:
        BadInput: as of ``RunReader``.
        NothingReadable: no part of the log has a record at its beginning that can be read.
    """
    return next(iter(RunReader(run, beginnings=True)))


def find_header(run: Path) -> Header | None:
    """Return what ran, None if the log does not say. If the first header is damaged, a later part repeats it.

    Raises:
        BadInput: as of ``RunReader``.
        NothingReadable: as of ``first_record``.
    """
    return next((record for record in RunReader(run, beginnings=True) if isinstance(record, Header)), None)


def log_segments(run: Path) -> list[Path]:
    """Return the files of a run's log, oldest first; of a single file, that file.

    Raises:
        BadInput: the folder cannot be read, or there is no log in it.
    """
    if run.is_file():
        return [run]
    try:
        parts = parts_of(run)
    except OSError as error:
        raise BadInput(f"{run}: cannot be read: {error.strerror}") from None
    if not parts:
        raise BadInput(no_run(run))
    return parts


def open_log(segment: Path) -> IO[bytes]:
    """Open a file of a log, also one that was packed with gzip.

    Raises:
        OSError: it cannot be opened, or is a pipe or a device.
    """
    file = cast(BufferedReader, open_regular(segment, READ_BYTES))
    if not file.peek(2).startswith(GZIP):
        return file
    packed = gzip.GzipFile(fileobj=file)
    packed.myfileobj = cast(FileIO, file)  # closed with it
    return cast(IO[bytes], packed)


def go_to_last(file: IO[bytes], size_bytes: int) -> int:
    """Go to the last so many bytes of a file, and return how many are before them.

    Of a packed file at most ``PACKED_BYTES`` are looked through: a small one may hold any number.
    """
    end = file.seek(PACKED_BYTES) if isinstance(file, gzip.GzipFile) else file.seek(0, os.SEEK_END)
    return file.seek(max(0, end - size_bytes))


def _lines(file: IO[bytes], most_bytes: int) -> Iterator[bytes]:
    """Give the lines of a file; of one that is too long its first bytes, or its last if NUL bytes fill it.

    Raises:
        OSError: it cannot be read, or goes on after so many bytes.
    """
    left_bytes = most_bytes
    while line := file.readline(LINE_BYTES):
        first = line
        left_bytes -= len(line)
        while len(line) == LINE_BYTES and not line.endswith(b"\n") and left_bytes > 0:
            line = file.readline(LINE_BYTES)
            left_bytes -= len(line)
        if left_bytes < 0:
            raise OSError(errno.EFBIG, f"it has more than {most_bytes:,} bytes")
        yield line if b"\0" in line else first
