"""The formats that a run can be exported as: one row each."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, StrEnum
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wayfarer.fieldlog.reader import Damage


class Output(Enum):
    """What a format is written to, and what its writer takes besides the run's folder."""

    TEXT = "text"  # an open text file, which may be a terminal
    BYTES = "bytes"  # an open binary file that can seek
    FOLDER = "folder"  # the path of a folder that the writer makes


class ExportFormat(StrEnum):
    """A format. Its value is also the ending of a file's name.

    ``meaning`` is for people. ``needs`` names what it needs installed (``wayfarer.cli.extras``), None for nothing.
    ``writer`` is a function below ``wayfarer.views``: it takes the run's folder and the target, writes the run, and
    returns what of the log could not be read. It raises BadInput where there is nothing to write.
    """

    meaning: str
    output: Output
    needs: str | None
    writer: str

    csv = "csv", "one row per tick", Output.TEXT, None, "export.tables:write_csv"
    tsv = "tsv", "the paper's columns", Output.TEXT, None, "export.tables:write_tsv"
    parquet = "parquet", "the rows of csv, with types", Output.BYTES, "Parquet", "export.parquet:write_parquet"
    gpx = "gpx", "track and waypoints for maps", Output.TEXT, None, "export.gpx:write_gpx"
    geojson = "geojson", "the same for web maps", Output.TEXT, None, "export.geojson:write_geojson"
    mcap = "mcap", "Foxglove", Output.BYTES, "Foxglove", "foxglove.mcap_file:write_mcap"
    rosbag2 = "rosbag2", "ROS 2", Output.FOLDER, "rosbag2", "export.rosbag2:write_rosbag2"

    def __new__(cls, ending: str, meaning: str, output: Output, needs: str | None, writer: str) -> ExportFormat:
        """Make a row."""
        row = str.__new__(cls, ending)
        row._value_, row.meaning, row.output, row.needs, row.writer = ending, meaning, output, needs, writer
        return row

    def write(self, run: Path, target: Any) -> Damage:
        """Write a run, and return what of it could not be read.

        Raises:
            BadInput: nothing of the run can be read, or it has nothing that this format can hold.
            OSError: the target takes no more.
        """
        write: Callable[[Path, Any], Damage] = resolve_name(f"wayfarer.views.{self.writer}")
        return write(run, target)
