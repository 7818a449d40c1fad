"""The files of one run's log, written where waiting is allowed: here, or in ``thread.WriterThread``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import FILE_NAME


class LineSink(Protocol):
    """Takes the lines of a log, each one JSON object without its end of line. No method but ``open`` raises.

    ``dropped`` counts the lines that could not be written.
    """

    dropped: int

    def open(self, header: Callable[[int], bytes]) -> None:
        """Make the files; ``header`` gives the first line of each part of the log, by the part's number from 1.

        Raises:
            BadInput: they cannot be made.
        """

    def bulk(self, line: bytes) -> None:
        """Take a line of which there are many, and without which the log still tells the story."""

    def urgent(self, line: bytes) -> None:
        """Take a line that must be on the disk soon, and that is dropped last."""

    def close(self) -> None:
        """Write everything and close the files."""


class RunFiles:
    """Writes the lines of one run into its folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.dropped = 0

    def open(self, header: Callable[[int], bytes]) -> None:
        """Make folder and file, and write the header; see ``LineSink``."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._file = (self._folder / FILE_NAME).open("xb")
        except OSError as error:
            raise BadInput(f"{self._folder}: the field log cannot be written: {error.strerror}") from None
        self.urgent(header(1))

    def bulk(self, line: bytes) -> None:
        """Write a line; see ``LineSink``."""
        try:
            self._file.write(line + b"\n")
        except (OSError, ValueError):
            self.dropped += 1

    def urgent(self, line: bytes) -> None:
        """Write a line; see ``LineSink``."""
        self.bulk(line)

    def close(self) -> None:
        """Close the file; see ``LineSink``."""
        try:
            self._file.close()
        except OSError:
            self.dropped += 1
