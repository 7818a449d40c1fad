"""Exports a run to a file or folder of another format, which appears whole or not at all; one row for each format."""

from __future__ import annotations

import os
from collections.abc import Callable
from enum import Enum, StrEnum
from io import TextIOWrapper
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from wayfarer.errors import BadInput
from wayfarer.files import atomic_file, atomic_folder

if TYPE_CHECKING:
    from wayfarer.fieldlog.reader import Damage

DESKTOP = ("xdg-open",)
PYTHON = ("python", "-ic", "import sys, pyarrow.parquet as p; run = p.read_table(sys.argv[1]); print(run.schema)")


class Output(Enum):
    """What a format is written to, and what its writer takes besides the run's folder."""

    TEXT = "text"  # an open text file, which may be a terminal
    BYTES = "bytes"  # an open binary file that can seek
    FOLDER = "folder"  # the path of a folder that the writer makes


class ExportFormat(StrEnum):
    """A format. Its value is also the ending of a file's name.

    ``meaning`` is for people. ``needs`` names what it needs installed (``wayfarer.extras``), None for nothing.
    ``writer`` is a function below ``wayfarer.views``: it takes the run's folder and the target, writes the run, and
    returns what of the log could not be read. It raises BadInput where there is nothing to write. ``opened_by`` is a
    command that takes the file's name. For a bag it is not one that plays: it has ``/cmd_vel``, and a robot would obey.
    """

    meaning: str
    output: Output
    needs: str | None
    writer: str
    opened_by: tuple[str, ...]

    csv = "csv", "one row per tick", Output.TEXT, None, "export.tables:write_csv", DESKTOP
    parquet = "parquet", "the rows of csv, with types", Output.BYTES, "Parquet", "export.parquet:write_parquet", PYTHON
    gpx = "gpx", "track and waypoints for maps", Output.TEXT, "gpx", "export.gpx:write_gpx", DESKTOP
    geojson = "geojson", "the same for web maps", Output.TEXT, "geojson", "export.geojson:write_geojson", DESKTOP
    mcap = "mcap", "Foxglove", Output.BYTES, "mcap", "export.mcap:write_mcap", DESKTOP
    rosbag2 = "rosbag2", "ROS 2", Output.FOLDER, "rosbag2", "export.rosbag2:write_rosbag2", ("ros2", "bag", "info")

    def __new__(
        cls, ending: str, meaning: str, output: Output, needs: str | None, writer: str, opened_by: tuple[str, ...]
    ) -> ExportFormat:
        """Make a row."""
        row = str.__new__(cls, ending)
        row._value_, row.meaning, row.output, row.needs = ending, meaning, output, needs
        row.writer, row.opened_by = writer, opened_by
        return row

    def write(self, run: Path, target: Any, origin: str | None = None) -> Damage:
        """Write a run, and return what of it could not be read.

        ``origin`` is latitude and longitude in degrees of where a run without a receiver began, as ``50.937,-1.397``.

        Raises:
            BadInput: nothing of the run can be read, it has nothing that this format can hold, or the origin is none.
            OSError: the target takes no more.
        """
        write: Callable[..., Damage] = resolve_name(f"wayfarer.views.{self.writer}")
        if origin is None:
            return write(run, target)
        if self not in ON_THE_GLOBE:
            raise BadInput(f"--origin is for {' and '.join(ON_THE_GLOBE)}, and this is {self}: leave --origin out")
        from wayfarer.views.export.placed_path import Origin

        return write(run, target, Origin.of(origin))


ON_THE_GLOBE = (ExportFormat.gpx, ExportFormat.geojson)  # what needs latitude and longitude


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
        BadInput: there is such a file already, it cannot be written or is no ordinary file, or the run cannot be read.
            A folder is never replaced.
    """
    try:
        if form.output is Output.FOLDER:
            return _export_folder(run, form, out, origin)
        if out.is_dir() or (out.exists() and not overwrite):
            raise BadInput(f"{out} exists already: name another file with --out, or replace it with --force")
        with atomic_file(out, follow_symlink=follow_symlink) as draft:
            if form.output is Output.BYTES:
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


def _export_folder(run: Path, form: ExportFormat, out: Path, origin: str | None) -> Damage:
    if os.path.lexists(out):
        raise BadInput(
            f"{out} exists already, and a folder is never replaced: name another one with --out, or remove it"
        )
    with atomic_folder(out) as draft:
        return form.write(run, draft, origin)
