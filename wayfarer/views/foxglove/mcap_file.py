"""Converts a run's log to an MCAP file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import orjson
from foxglove import Context, open_mcap
from foxglove.mcap import MCAPWriter

from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.typed import Header
from wayfarer.views.export.run_metadata import run_metadata
from wayfarer.views.export.wall_time import nanoseconds, read_clock_zero_s
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
    began_ns = nanoseconds(zero_s + next(iter(RunReader(run)))["t_s"])
    context = Context()
    channels = Channels(context)
    sink = _Sink(file)
    writer = open_mcap(sink, context=context)
    try:
        for record in RunReader(run):
            channels.take(record, zero_s + record["t_s"])
            sink.check()
        _describe(writer, channels.header, began_ns)
    finally:
        try:
            writer.close()
        except RuntimeError:  # it says that something was not written; the sink knows why
            sink.check()
            raise
    return reader.damage


def _describe(writer: MCAPWriter, header: Header, began_ns: int) -> None:
    """Add what ran: as a metadata record, and the rover file's settings as an attachment."""
    writer.write_metadata("wayfarer", run_metadata(header))
    if header.config is not None:
        settings = orjson.dumps(header.config, option=orjson.OPT_INDENT_2)
        writer.attach(
            log_time=began_ns, create_time=began_ns, name="rover.json", media_type="application/json", data=settings
        )


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
