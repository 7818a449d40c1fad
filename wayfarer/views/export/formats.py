"""The formats that a run can be exported as: one row each."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, StrEnum
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

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

    ``meaning`` is for people. ``needs`` names what it needs installed (``wayfarer.cli.extras``), None for nothing.
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
    tsv = "tsv", "the paper's columns", Output.TEXT, None, "export.tables:write_tsv", DESKTOP
    parquet = "parquet", "the rows of csv, with types", Output.BYTES, "Parquet", "export.parquet:write_parquet", PYTHON
    gpx = "gpx", "track and waypoints for maps", Output.TEXT, None, "export.gpx:write_gpx", DESKTOP
    geojson = "geojson", "the same for web maps", Output.TEXT, None, "export.geojson:write_geojson", DESKTOP
    mcap = "mcap", "Foxglove", Output.BYTES, "Foxglove", "foxglove.mcap_file:write_mcap", DESKTOP
    rosbag2 = "rosbag2", "ROS 2", Output.FOLDER, "rosbag2", "export.rosbag2:write_rosbag2", ("ros2", "bag", "info")

    def __new__(
        cls, ending: str, meaning: str, output: Output, needs: str | None, writer: str, opened_by: tuple[str, ...]
    ) -> ExportFormat:
        """Make a row."""
        row = str.__new__(cls, ending)
        row._value_, row.meaning, row.output, row.needs = ending, meaning, output, needs
        row.writer, row.opened_by = writer, opened_by
        return row

    def write(self, run: Path, target: Any) -> Damage:
        """Write a run, and return what of it could not be read.

        Raises:
            BadInput: nothing of the run can be read, or it has nothing that this format can hold.
            OSError: the target takes no more.
        """
        write: Callable[[Path, Any], Damage] = resolve_name(f"wayfarer.views.{self.writer}")
        return write(run, target)
