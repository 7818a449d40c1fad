"""Reads a log back despite damage: power cuts, a full disk, a failing card.

What a line is worth is judged by ``lines``, for the ends of logs and following as well; only here is it counted.
Every record that is as it was written, holds what its kind may hold (``schema``) and is in its place is given; what is
not is skipped, and counted by what is wrong with it. A line that was being written when the power went has no end, or
is filled with NUL bytes; nothing after it is lost, because the next segment and the next run have files of their own.
Memory does not grow with the log, nor with what is broken in it.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from wayfarer import __version__
from wayfarer.errors import BadInput, NothingReadable
from wayfarer.fieldlog.folders import part_name, parts_of
from wayfarer.fieldlog.lines import LINE_BYTES, LogLines, is_newer
from wayfarer.fieldlog.schema import SCHEMA, Record
from wayfarer.files import open_regular

READ_BYTES = 262_144  # read from the disk at once
# What is read of a part of a log, at most: twice what ``part_mb`` may be, and more than a simulated trial writes.
PART_BYTES = 4_000_000_000
BROKEN_LINES = 200_000  # of a run are skipped, at most: a file of garbage is not read for hours
FIRST_LINES = 16  # of a part are its beginning: where some of them are broken, the others still tell when it was
OF_THE_WHOLE = ("unreadable", "headless", "missing")  # counts that are not of lines
OF_A_PART = ("t_s", "t_wall", "part")  # what the headers of a run differ in


@dataclass
class Damage:
    """What could not be read; its text says it to a person.

    Lines: ``torn`` has no end, ``nul`` holds NUL bytes where the disk had nothing yet, ``oversized`` has more than
    ``LINE_BYTES``, ``changed`` does not have its checksum, ``garbled`` is no JSON object with a known ``record``,
    ``wrong`` holds a value that cannot be, ``foreign`` is a header that says that something else ran than the first one
    says, and ``disordered`` has a number that does not grow, as a line that is there twice. ``unreadable`` segments
    could not be read to their end. ``headless`` segments do not begin with what ran. ``missing`` counts the records
    that are not there, by their numbers: those in skipped lines, those that the disk could not take, and those in
    segments that were deleted.
    """

    torn: int = 0
    nul: int = 0
    oversized: int = 0
    changed: int = 0
    garbled: int = 0
    wrong: int = 0
    foreign: int = 0
    disordered: int = 0
    unreadable: int = 0
    headless: int = 0
    missing: int = 0

    @property
    def lines(self) -> int:
        """How many lines were skipped."""
        return sum(getattr(self, field.name) for field in fields(self) if field.name not in OF_THE_WHOLE)

    def __bool__(self) -> bool:
        return self != Damage()

    def __str__(self) -> str:
        counts = [(getattr(self, field.name), SAID[field.name]) for field in fields(self)]
        told = (one if count == 1 else f"{count} {many}" for count, (one, many) in counts if count)
        return ", ".join(told) or "complete"


SAID = {
    "torn": ("1 line is torn", "lines are torn"),
    "nul": ("1 line is filled with NUL bytes", "lines are filled with NUL bytes"),
    "oversized": ("1 line is far too long", "lines are far too long"),
    "changed": ("1 line was changed after it was written", "lines were changed after they were written"),
    "garbled": ("1 line is no record", "lines are no records"),
    "wrong": ("1 record holds an impossible value", "records hold impossible values"),
    "foreign": ("1 header is of another run", "headers are of another run"),
    "disordered": ("1 record is out of order", "records are out of order"),
    "unreadable": ("1 part of the log cannot be read", "parts of the log cannot be read"),
    "headless": ("1 part of the log does not begin with its header", "parts of the log do not begin with their header"),
    "missing": ("1 record is missing", "records are missing"),
}


class RunReader:
    """Reads the records of one run in their order; ``damage`` is complete once all of them were read.

    Iterate it once. The header of a later segment of the log is given as well, as another ``run`` record.

    Args:
        run: a run's folder.
        beginnings: read only the first lines of each segment, quickly whatever is in it.

    Raises:
        BadInput: the folder cannot be read, or there is no log in it; while iterating, a newer wayfarer has written it.
        NothingReadable: while iterating, there was no record that can be read.
    """

    def __init__(self, run: Path, *, beginnings: bool = False) -> None:
        self.run = run
        self._part_bytes = LINE_BYTES if beginnings else PART_BYTES
        self._part_lines = FIRST_LINES if beginnings else None
        self.damage = Damage()
        self.segments = log_segments(run)
        self._log_lines = LogLines()
        self._ran: Record | None = None  # what the first header says

    def __iter__(self) -> Iterator[Record]:
        empty = True
        for record in self._whole():
            if empty:
                self.damage.headless = max(self.damage.headless, int(record["record"] != "run"))
                empty = False
            self.damage.missing = self._log_lines.missing
            yield record
        if empty:
            lost = self.damage if self.damage else "it is empty"
            raise NothingReadable(f"{self.run}: nothing in this log can be read ({lost})")

    def _whole(self) -> Iterator[Record]:
        """Give the records of all segments that are whole and in their place."""
        readable = False
        for segment in self.segments:
            begun = False
            try:
                with open_regular(segment, READ_BYTES) as file:
                    for line in islice(_lines(file, self._part_bytes), self._part_lines):
                        if (record := self._record(line, segment)) is not None:
                            if not begun:
                                readable = begun = True
                                self.damage.headless += record["record"] != "run"
                            yield record
            except OSError as error:
                self.damage.unreadable += 1
                if self.damage.unreadable == len(self.segments) and not readable:
                    raise NothingReadable(f"{segment}: cannot be read: {error.strerror}") from None

    def _record(self, line: bytes, segment: Path) -> Record | None:
        """Return the record of a line, or count what is wrong with it; a hole of NULs may end where a line begins."""
        record = self._log_lines.take(line)
        if isinstance(record, dict):
            return record if record["record"] != "run" else self._header(record, segment)
        self._skip(record)
        after = self._log_lines.take(line.rpartition(b"\0")[2]) if record == "nul" else None
        return after if isinstance(after, dict) else None

    def _header(self, header: Record, segment: Path) -> Record | None:
        """Return a header of this run; where one has a known schema, one of a newer schema is damage."""
        if is_newer(header):
            if self._ran is None:
                refuse_newer(header, segment, self.segments)
            self._skip("wrong")
            return None
        ran = {key: value for key, value in header.items() if key not in OF_A_PART}
        self._ran = self._ran or ran
        if ran != self._ran:
            self._skip("foreign")
            return None
        return header

    def _skip(self, kind: str) -> None:
        """Count a line that is left out.

        Raises:
            OSError: there are too many for a log; the rest of this segment counts as ``unreadable``.
        """
        setattr(self.damage, kind, getattr(self.damage, kind) + 1)
        if self.damage.lines > BROKEN_LINES:
            raise OSError(errno.EFBIG, f"more than {BROKEN_LINES:,} of its lines are no records")


def refuse_newer(header: Record, segment: Path, segments: Sequence[Path]) -> None:
    """Refuse a log that a newer wayfarer has written: its keys may mean something else.

    Raises:
        BadInput: a header says so, and no segment of the log begins with one of a known schema.
    """
    if is_newer(header) and all(is_newer(each) for _, each in _headers(segments)):
        known = f"wayfarer {__version__} knows up to {SCHEMA}"
        raise BadInput(f"{segment}: this log has schema {header['schema']}, {known}: update wayfarer to read it")


def first_record(run: Path) -> Record:
    """Return the first record of a run; quickly, whatever is in its folder.

    Raises:
        BadInput: as of ``RunReader``.
        NothingReadable: no part of the log has a record at its beginning that can be read.
    """
    return next(iter(RunReader(run, beginnings=True)))


def read_header(run: Path) -> Record:
    """Return the first record of a run: what ran. If it is damaged, a later segment of the log repeats it.

    Raises:
        BadInput: there is no log, or no segment of it begins with such a record.
    """
    segments = log_segments(run)
    for segment, header in _headers(segments):
        refuse_newer(header, segment, segments)
        if not is_newer(header):
            return header
    raise BadInput(f"{segments[0]} is no field log: its first record does not say what ran")


def _headers(segments: Sequence[Path]) -> Iterator[tuple[Path, Record]]:
    """Give the headers with which segments of a log begin."""
    for segment in segments:
        with suppress(OSError), open_regular(segment) as file:
            first = LogLines().take(file.readline(LINE_BYTES))
            if isinstance(first, dict) and first["record"] == "run":
                yield segment, first


def log_segments(run: Path) -> list[Path]:
    """Return the files of a run's log, oldest first.

    Raises:
        BadInput: the folder cannot be read, or there is no log in it.
    """
    try:
        parts = parts_of(run)
    except OSError as error:
        raise BadInput(f"{run}: cannot be read: {error.strerror}") from None
    if not parts:
        raise BadInput(f"{run} is no run: there is no {part_name(1)} in it")
    return parts


def _lines(file: BinaryIO, most_bytes: int) -> Iterator[bytes]:
    """Give the lines of a file; of one that is too long its first bytes, or its last where NUL bytes fill it.

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
