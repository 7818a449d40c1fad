"""Writes the lines of a run's log to its files; it may block, so it runs in a thread.

Disk errors are not raised after ``open``: a line that cannot be written is dropped and counted, a record in the log
says how much is missing and where, and a message is shown to the person.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import Protocol

from wayfarer.config.log_settings import UNLIMITED, LogSettings
from wayfarer.errors import BadInput
from wayfarer.fieldlog.disk_errors import DRIVES_ON, DiskErrorReporter, error_advice
from wayfarer.fieldlog.disk_space import free_mb
from wayfarer.fieldlog.lines import sealed_at
from wayfarer.fieldlog.rotation import SegmentRotation
from wayfarer.fieldlog.segment import Segment

BATCH_BYTES = 65_536  # what is written at once, unless it is asked for earlier
LOG_GAP = {"record": "event", "t_s": None, "t_wall": None, "name": "log_gap"}  # the times come from ``sealed_at``
RELIEF = 1.1  # so much more than ``free_mb`` must be free before control ticks are written again


class LineSink(Protocol):
    """Takes the lines of a log, each one JSON object without its end of line. No method but ``open`` raises."""

    @property
    def dropped(self) -> int:
        """How many lines could not be written."""

    def open(self, header: Callable[[int], bytes]) -> None:
        """Make the files; ``header`` gives the first line of each segment of the log, by the segment's number from 1.

        Raises:
            BadInput: they cannot be made.
        """

    def bulk(self, line: bytes) -> None:
        """Take a line of a frequent kind, without which the log is still useful."""

    def urgent(self, line: bytes) -> None:
        """Take a line that must be on the disk soon, and that is dropped last."""

    def close(self) -> None:
        """Write everything and close the files."""


class RunFiles:
    """Writes the lines of one run into its folder.

    Urgent lines are on the disk when ``urgent`` returns; for the others somebody must call ``sync``, once a second: it
    also tries again what failed. A line counts as written when it was synced: what could not be is dropped, even if
    some of it should turn up later.

    Args:
        folder: the run's folder; made where it is not there.
        settings: limits in size.
        tell: takes a line for the person when the log has trouble, and when it is over.
    """

    def __init__(
        self, folder: Path, settings: LogSettings = UNLIMITED, tell: Callable[[str], None] = lambda _: None
    ) -> None:
        self.dropped = 0
        self._folder = folder
        self._settings = settings
        self.trouble = DiskErrorReporter(tell)
        self._counting = Lock()
        self._batch: list[bytes] = []
        self._batch_bytes = 0
        self._unsynced = 0
        self._gap = 0
        self._failing = self._try_again = self._scarce = self._closed = False

    def open(self, header: Callable[[int], bytes]) -> None:
        """Make folder and file, and write the header; see ``LineSink``."""
        try:
            self._rotation = SegmentRotation(self._folder, self._settings, header)
        except OSError as error:
            raise BadInput(f"{self._folder}: the field log cannot be written: {error_advice(error)}") from None

    def bulk(self, line: bytes) -> None:
        """Write a line with the next batch; see ``LineSink``."""
        if self._scarce:
            self.lose(1)
        else:
            self._take(line)
            if self._batch_bytes >= BATCH_BYTES:
                self.flush()

    def urgent(self, line: bytes) -> None:
        """Write a line, and all before it, to the disk; see ``LineSink``."""
        self._take(line)
        self.sync()

    def flush(self) -> None:
        """Hand what was taken to the operating system: the end of this process cannot harm it any more."""
        lines, self._batch, self._batch_bytes = self._batch, [], 0
        if not lines:
            return
        if self._closed or (self._failing and not self._try_again):
            self.lose(len(lines))
            return
        self._try_again = False
        try:
            self._append(lines)
        except OSError as error:
            self._fail(error)

    def sync(self) -> None:
        """Have everything on the disk, look whether there is room for more, and try again what failed."""
        self._try_again = True
        self._look_for_room()
        self.flush()
        segment = self._rotation.newest
        if segment is None or self._failing:
            return
        try:
            self._sync(segment)
        except OSError as error:
            self._fail(error)
            self._try_again = True  # in a new segment, without waiting for another second
        else:
            if not self._scarce:
                self.trouble.ends("disk", self.dropped)

    def lose(self, lines: int) -> None:
        """Count lines that are dropped, and have the log say so before the next one."""
        self.count(lines)
        self.gap(lines)

    def count(self, lines: int) -> None:
        """Count lines that are dropped; safe from any thread."""
        with self._counting:
            self.dropped += lines

    def gap(self, lines: int) -> None:
        """Have the log say how many lines are missing before the next one."""
        self._gap += lines

    def close(self) -> None:
        """Write everything and close the file; see ``LineSink``."""
        self.sync()
        self._closed = True
        self._rotation.close()

    def _take(self, line: bytes) -> None:
        self._batch.append(line)
        self._batch_bytes += len(line) + 1

    def _append(self, lines: list[bytes]) -> None:
        left = len(lines)
        try:
            segment = self._segment_for(lines)
            if self._gap:
                segment.append([sealed_at(lines[0], LOG_GAP | {"dropped": self._gap})])
                self._gap = 0
            before = segment.lines
            try:
                segment.append(lines)
            finally:
                self._unsynced += segment.lines - before
                left -= segment.lines - before
            self._failing = False
        finally:
            self.lose(left)

    def _segment_for(self, lines: list[bytes]) -> Segment:
        """Return the segment that takes these lines."""
        segments = self._rotation
        if segments.newest is None or not segments.newest.fit:
            return segments.begin(lines[0])
        if segments.fills(lines):
            self._look_for_room()
            if not self._scarce:
                self._sync(segments.newest)
                segments.rotate(lines[0])
        return segments.newest

    def _look_for_room(self) -> None:
        enough_mb = self._settings.free_mb * (RELIEF if self._scarce else 1.0)
        try:
            self._scarce = free_mb(self._folder) < enough_mb
        except OSError:
            return
        if self._scarce:
            text = f"the field log takes only events and positions: less than {self._settings.free_mb:g} MB are free"
            self.trouble.begins("disk", f"{self._folder}: {text}: delete old runs{DRIVES_ON}")

    def _sync(self, segment: Segment) -> None:
        try:
            segment.sync()
        except OSError:
            self.lose(self._unsynced)
            raise
        finally:
            self._unsynced = 0

    def _fail(self, error: OSError) -> None:
        self._failing = True
        text = f"{self._folder}: the field log cannot be written: {error_advice(error)}{DRIVES_ON}"
        self.trouble.begins("disk", text)
