"""Writes the lines of a run's log to its files; it may block, so on a rover it runs in ``writer_thread``.

Disk errors are not raised after ``open``: a line that cannot be written is dropped and counted, a record in the log
says how much is missing and where, and a message is shown to the person.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wayfarer.config.rover_file import UNLIMITED, LogSettings
from wayfarer.errors import BadInput
from wayfarer.fieldlog.disk import DISK_FAILS, DRIVES_ON, DiskTrouble, error_advice, free_mb
from wayfarer.fieldlog.lines import sealed_at
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.segments import Segment, SegmentRotation

BATCH_BYTES = 65_536  # what is written at once, unless it is asked for earlier
LOG_GAP = {"record": "event", "t_s": None, "t_wall": None, "name": "log_gap"}  # the times come from ``sealed_at``
RELIEF = 1.1  # so much more than ``free_mb`` must be free before control ticks are written again


class RunFiles:
    """Writes the lines of one run into its folder; each line is one JSON object without its end.

    Urgent lines are on the disk when ``urgent`` returns; for the others somebody must call ``sync``, once a second: it
    also tries again what failed. A line counts as written when it was synced: what could not be is dropped, even if
    some of it should turn up later. ``dropped`` counts those lines, and ``trouble`` says why. Only ``open`` raises.

    Args:
        folder: the run's folder; made if it is not there.
        settings: limits in size.
        tell: takes a line for the person when the log has trouble, and when it is over.
        clock: gives seconds, to measure by ``slowest_sync_s`` how long the disk takes.
    """

    def __init__(
        self,
        folder: Path,
        settings: LogSettings = UNLIMITED,
        tell: Callable[[str], None] = lambda _: None,
        clock: Callable[[], float] = lambda: 0.0,
    ) -> None:
        self.dropped = 0
        self.slowest_sync_s = 0.0
        self.trouble = DiskTrouble(tell)
        self._folder = folder
        self._settings = settings
        self._clock = clock
        self._batch: list[bytes] = []
        self._batch_bytes = 0
        self._unsynced = 0
        self._gap = 0  # dropped lines that no ``log_gap`` tells of yet
        self._failing = self._try_again = self._scarce = self._closed = False

    def open(self, header: Callable[[int], Record], *, needed: bool = True) -> None:
        """Make folder and file.

        Args:
            header: gives the first record of each segment of the log, by its number from 1.
            needed: if not, a disk that is full, failing or read-only is tried again later, as during the run.

        Raises:
            BadInput: they cannot be made.
        """
        self._rotation = SegmentRotation(self._folder, self._settings, header)
        try:
            self._rotation.open()
        except OSError as error:
            if needed or error.errno not in DISK_FAILS:
                raise BadInput(f"{self._folder}: the field log cannot be written: {error_advice(error)}") from None
            self._fail(error)

    def bulk(self, line: bytes) -> None:
        """Write a line of a frequent kind with the next batch; without such lines the log is still useful."""
        if self._scarce:
            self.lose(1)
            return
        self._take(line)
        if self._batch_bytes >= BATCH_BYTES:
            self.flush()

    def urgent(self, line: bytes) -> None:
        """Write a line, and all before it, to the disk; it is dropped last."""
        self._take(line)
        self.sync()

    def flush(self) -> None:
        """Hand what was taken to the operating system: the end of this process cannot harm it any more."""
        lines, self._batch, self._batch_bytes = self._batch, [], 0
        if self._closed or (self._failing and not self._try_again):
            self.lose(len(lines))
        elif lines:
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
        self.dropped += lines
        self.tell_of_gap(lines)

    def tell_of_gap(self, lines: int) -> None:
        """Have the log say before the next line how many are missing."""
        self._gap += lines

    def close(self) -> None:
        """Write everything and close the file; what comes later is dropped."""
        self.sync()
        self._closed = True
        self._rotation.close()

    def _take(self, line: bytes) -> None:
        self._batch.append(line)
        self._batch_bytes += len(line) + 1

    def _append(self, lines: list[bytes]) -> None:
        written = 0
        try:
            segment = self._segment_for(lines)
            if self._gap:
                segment.append([sealed_at(lines[0], LOG_GAP | {"dropped": self._gap})])
                self._gap = 0
            before = segment.lines
            try:
                segment.append(lines)
            finally:
                written = segment.lines - before
                self._unsynced += written
            self._failing = False
        finally:
            self.lose(len(lines) - written)

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
        began_s = self._clock()
        try:
            segment.sync()
        except OSError:
            self.lose(self._unsynced)
            raise
        finally:
            self._unsynced = 0
            self.slowest_sync_s = max(self.slowest_sync_s, self._clock() - began_s)

    def _fail(self, error: OSError) -> None:
        self._failing = True
        text = f"{self._folder}: the field log cannot be written: {error_advice(error)}{DRIVES_ON}"
        self.trouble.begins("disk", text)
