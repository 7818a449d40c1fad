"""Follows a run while it is written: into the next file of its log, and into the next run.

Files are read as they grow, without locks. A line counts once its end is written.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO

from wayfarer.errors import BadInput, NothingReadable
from wayfarer.fieldlog.folders import newest_run
from wayfarer.fieldlog.reader import CANNOT_BE_READ, LINE_BYTES, Lines, first_record, go_to_last, log_segments, open_log
from wayfarer.fieldlog.record import AnyRecord, Outcome

RECENT_BYTES = 65_536  # where following begins: some seconds back, however long the run is
CHUNK_BYTES = 65_536


def follow(logs: Path, run: Path | None, wait: Callable[[], None]) -> Iterator[tuple[Path, AnyRecord]]:
    """Give each record with the folder of its run, as they come; ``wait`` is called whenever there is none.

    ``logs`` is the folder of all runs. ``run`` is followed to its outcome; None follows the newest and each later run,
    without end.
    """
    tail = None if run is None else RunTail(run)
    try:
        while True:
            newest = newest_run(logs) if run is None else None
            if tail is not None:
                for record in tail.read():
                    yield tail.run, record
                    if run is not None and isinstance(record, Outcome):
                        return
            if newest is None or (tail is not None and newest == tail.run):
                wait()
                continue
            if tail is not None:
                tail.close()
            tail = RunTail(newest)
    finally:
        if tail is not None:
            tail.close()


class RunTail:
    """The records of one run as they come: its first one, the last few that are there, and then all.

    ``run`` is its folder; the log in it need not be there yet.
    """

    def __init__(self, run: Path) -> None:
        self.run = run
        self._file: IO[bytes] | None = None
        self._segment = run  # the open one
        self._rest = b""
        self._lines = Lines()

    def read(self) -> Iterator[AnyRecord]:
        """Give what has come since the last call."""
        try:
            if self._file is None:
                yield from self._begin()
            if self._file is None:
                return
            yield from self._read(self._file)
            while (segment := self._next_segment()) is not None:
                yield from self._read(self._file)  # what came between reading and looking
                file = self._open(segment)
                if file is None:
                    return
                yield from self._read(file)
        except CANNOT_BE_READ as error:
            raise BadInput(f"{self.run}: cannot be read: {error}") from None

    def close(self) -> None:
        """Close the file; safe twice."""
        if self._file is not None:
            self._file.close()

    def _begin(self) -> Iterator[AnyRecord]:
        segments = self._segments()
        if not segments:
            return
        file = self._open(segments[-1])
        if file is None:
            return
        skipped = go_to_last(file, RECENT_BYTES)
        if skipped or len(segments) > 1:
            with suppress(NothingReadable):  # not yet
                yield first_record(self.run)  # it says what runs
        if skipped:
            file.readline()  # only its end is there

    def _read(self, file: IO[bytes]) -> Iterator[AnyRecord]:
        """Give what has come, each number once."""
        while chunk := file.read(CHUNK_BYTES):
            *lines, self._rest = (self._rest + chunk).split(b"\n")
            if len(self._rest) > LINE_BYTES:
                self._rest = b""  # no record is so long; the line's end will not be one either
            for line in lines:
                try:
                    record = self._lines.parse(line)
                except BadInput as error:
                    raise BadInput(f"{self.run}: {error}") from None
                if record is not None:
                    yield record

    def _next_segment(self) -> Path | None:
        """Return the segment of the log that follows the open one, if it has begun."""
        segments = self._segments()
        if self._segment in segments:
            return next(iter(segments[segments.index(self._segment) + 1 :]), None)
        return segments[-1] if segments else None  # the open one was deleted to make room: it is far behind

    def _segments(self) -> list[Path]:
        try:
            return log_segments(self.run)
        except BadInput:
            if self.run.exists() and not os.access(self.run, os.R_OK | os.X_OK):
                raise
            return []  # not yet, or no more

    def _open(self, segment: Path) -> IO[bytes] | None:
        """Open a segment in the place of the one before; None if it was deleted since it was listed."""
        try:
            file = open_log(segment)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise BadInput(f"{segment}: cannot be read: {error.strerror}") from None
        self.close()
        self._file, self._segment, self._rest = file, segment, b""
        return file
