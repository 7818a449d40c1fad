"""Converts a run's log to an MCAP file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from foxglove import Context, open_mcap

from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.views.export.wall_time import read_clock_zero_s
from wayfarer.views.foxglove.channels import Channels


def write_mcap(run: Path, file: BinaryIO) -> Damage:
    """Write a run's log into an open file as MCAP, and return what of it could not be read.

    The same log gives the same bytes.

    Raises:
        BadInput: there is no log, or nothing in it can be read.
        OSError: the file takes no more.
    """
    reader = RunReader(run)
    zero_s = read_clock_zero_s(reader)
    context = Context()
    channels = Channels(context)
    sink = _Sink(file)
    writer = open_mcap(sink, context=context)
    try:
        for record in RunReader(run):
            channels.take(record, zero_s + record["t_s"])
            sink.check()
    finally:
        try:
            writer.close()
        except RuntimeError:  # it says that something was not written; the sink knows why
            sink.check()
            raise
    return reader.damage


class _Sink:
    """A file for the SDK's writer that remembers its first error: the SDK passes none on when it takes a message."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._error: OSError | None = None

    def check(self) -> None:
        """Raise the error that kept something from being written."""
        if self._error is not None:
            raise self._error

    def write(self, data: bytes | bytearray) -> int:
        with self._remembered():
            return self._file.write(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        with self._remembered():
            return self._file.seek(offset, whence)

    def flush(self) -> None:
        with self._remembered():
            self._file.flush()

    @contextmanager
    def _remembered(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._error = self._error or error
            raise
