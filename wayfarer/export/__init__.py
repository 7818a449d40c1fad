"""A run in the formats of other tools, one row for each; a file appears whole or not at all."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from io import TextIOWrapper
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from wayfarer.angles import clamp
from wayfarer.errors import BadInput
from wayfarer.files import atomic_file

if TYPE_CHECKING:
    from wayfarer.fieldlog.reader import Damage, RunReader


class ExportFormat(StrEnum):
    """A format. Its value is also the ending of a file's name.

    ``meaning`` is for people. ``is_text`` says what it is written to: an open text file, which may be a terminal, or an
    open binary file that can seek. ``needs`` names what it needs installed (``wayfarer.extras``), None for nothing.
    ``writer`` is a function beside this module: it takes the run's folder and the open file, writes the run, and
    returns what of the log could not be read. It raises BadInput if there is nothing to write.
    """

    meaning: str
    is_text: bool
    needs: str | None
    writer: str

    csv = "csv", "one row per tick", True, None, "tables:write_csv"
    gpx = "gpx", "track and waypoints for maps", True, "gpx", "gpx:write_gpx"
    mcap = "mcap", "Foxglove", False, "mcap", "mcap:write_mcap"

    def __new__(cls, ending: str, meaning: str, is_text: bool, needs: str | None, writer: str) -> ExportFormat:
        """Make a row."""
        row = str.__new__(cls, ending)
        row._value_, row.meaning, row.is_text, row.needs, row.writer = ending, meaning, is_text, needs, writer
        return row

    def write(self, run: Path, file: Any, origin: str | None = None) -> Damage:
        """Write a run, and return what of it could not be read.

        ``origin`` is latitude and longitude in degrees of where a run without a receiver began, as ``50.937,-1.397``.

        Raises:
            BadInput: nothing of the run can be read, it has nothing that this format can hold, or the origin is none.
            OSError: the file takes no more.
        """
        write: Callable[..., Damage] = resolve_name(f"wayfarer.export.{self.writer}")
        if origin is None:
            return write(run, file)
        if self is not ExportFormat.gpx:
            raise BadInput(f"--origin is for gpx, and this is {self}: leave --origin out")
        return write(run, file, origin)


def export(
    run: Path,
    form: ExportFormat,
    out: Path,
    *,
    overwrite: bool,
    follow_symlink: bool = False,
    origin: str | None = None,
) -> Damage:
    """Write a run in a format, and return what of its log could not be read.

    ``follow_symlink`` is for a path that a person gave, ``origin`` as for ``ExportFormat.write``.

    Raises:
        BadInput: there is such a file already, it cannot be written or is not an ordinary file, or the run cannot be
        read.
    """
    try:
        if out.is_dir() or (out.exists() and not overwrite):
            raise BadInput(f"{out} exists already: name another file with --out, or replace it with --force")
        with atomic_file(out, follow_symlink=follow_symlink) as draft:
            if not form.is_text:
                return form.write(run, draft, origin)
            text = TextIOWrapper(draft, encoding="utf-8", newline="")
            try:
                return form.write(run, text, origin)
            finally:
                text.detach()  # its end would close the draft
    except OSError as error:
        raise BadInput(
            f"{out} cannot be written: {error.strerror}; check the folder, its rights and the disk"
        ) from None


SECOND_NS = 1_000_000_000
LATEST_S = 2**32 - 1  # in the year 2106, where the seconds of Foxglove's times end


def read_clock_zero_s(reader: RunReader) -> float:
    """Read a run to its end, and return the time since 1970 at which its ``t_s`` was zero.

    It is right at the end of the log, where the rover's computer is most likely to know the time; times of all other
    records follow from it, so that they are in order.
    """
    (last,) = deque(reader, maxlen=1)
    return last.t_wall - last.t_s


def nanoseconds(time_s: float) -> int:
    """Return a time since 1970 as Foxglove counts it, to the microsecond: a float of today has no more."""
    return round(clamp(time_s, 0.0, LATEST_S) * 1e6) * 1000


def utc_time(wall_s: float) -> datetime:
    """Return a time since 1970 to the millisecond, within the same bounds as ``nanoseconds``."""
    return datetime.fromtimestamp(round(nanoseconds(wall_s) / 1e6) / 1e3, UTC)


def utc_stamp(wall_s: float) -> datetime:
    """Return a log's ``t_wall`` to the microsecond; it is from 1970 to 2286 (``record.Wall``)."""
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=round(wall_s * 1e6))
