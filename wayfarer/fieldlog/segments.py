"""The files of a log, its segments: lines go in whole or not at all, full files get a number, old ones are deleted.

The newest is always ``run.jsonl``, so that ``tail -F`` follows. It becomes ``run.00001.jsonl`` and so on, by the number
that its header gives; the next begins with the header again, so that each can be read alone.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path

from wayfarer.config.rover_file import LogSettings
from wayfarer.fieldlog.disk import MB
from wayfarer.fieldlog.folders import FILE_NAME, older_segments, segment_path
from wayfarer.fieldlog.lines import sealed, sealed_at
from wayfarer.fieldlog.schema import Record
from wayfarer.files import sync_folder

# Appending: whatever else happens to the file, a line never lands in the middle of it.
TICK = b'{"record":"tick"'
STANDS = b'"applied_left":0.0,"applied_right":0.0'  # in a tick with still wheels, as ``log.tick_fields`` orders it
FLAGS = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC


class Segment:
    """Makes a new file that begins with a header, and appends to it; what fails raises ``OSError``.

    ``lines`` and ``size`` count the whole lines in it and their bytes, the header's included; ``drove`` is whether a
    wheel turned in any of them. Once it is no longer ``fit``, it cannot be trusted with more lines: a write or its
    repair failed, or the file is not where it was made.

    Raises:
        OSError: it cannot be made, or exists; nothing is left of it then.
    """

    def __init__(self, path: Path, header: bytes) -> None:
        self._path = path
        self.lines = self.size = 0
        self.fit, self.drove = True, False
        self._file = os.open(path, FLAGS, 0o644)
        try:
            self.append([header])
            self.sync()
        except OSError:
            self.close()
            with suppress(OSError):
                path.unlink()
            raise
        sync_folder(path.parent)

    def append(self, lines: Iterable[bytes]) -> None:
        """Append lines, each without its end. If this fails, those that went in whole stay."""
        lines = list(lines)
        data, done = b"".join(line + b"\n" for line in lines), 0
        self.drove = self.drove or any(line.startswith(TICK) and STANDS not in line for line in lines)
        try:
            while done < len(data):
                done += os.write(self._file, memoryview(data)[done:])
        finally:
            whole = data.rfind(b"\n", 0, done) + 1
            self.size += whole
            self.lines += data.count(b"\n", 0, whole)
            if whole < done:
                self._cut()

    def sync(self) -> None:
        """Return when all is on the disk, and the file at its path is still this one, unchanged by other programs."""
        try:
            os.fdatasync(self._file)
            ours, there = os.fstat(self._file), self._path.stat()
            if not os.path.samestat(ours, there) or there.st_size != self.size:
                raise OSError(errno.ESTALE, "File was changed by another program")
        except OSError:
            self.fit = False
            raise

    def close(self) -> None:
        """Close the file; safe twice."""
        file, self._file = self._file, -1
        if file >= 0:
            with suppress(OSError):
                os.close(file)

    def _cut(self) -> None:
        """Take away the beginning of a line that did not go in whole."""
        try:
            os.ftruncate(self._file, self.size)
        except OSError:
            self.fit = False


class SegmentRotation:
    """Makes the segments of a log; ``newest`` is the one to be written, None if the last attempt to make one failed.

    Args:
        folder: the run's folder; made if it is not there.
        settings: limits in size.
        header: gives the first record of a segment, by its number from 1.
    """

    def __init__(self, folder: Path, settings: LogSettings, header: Callable[[int], Record]) -> None:
        self._folder = folder
        self._segment_bytes = settings.part_mb * MB
        self._run_bytes = settings.run_mb * MB
        self._header = header
        self._idle: set[Path] = set()  # segments in which no wheel turned
        self._number = self._empty_bytes = 0
        self._latest: Segment | None = None
        self.newest: Segment | None = None

    def open(self) -> None:
        """Make the first segment, in a folder without one.

        Raises:
            OSError: it cannot be made.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        self._make(1, sealed(self._header(1)))
        sync_folder(self._folder.parent)

    def fills(self, lines: list[bytes]) -> bool:
        """Whether these lines are too many for the newest segment."""
        segment = self.newest
        return segment is not None and segment.size + sum(map(len, lines)) > self._full_bytes

    def rotate(self, line: bytes) -> None:
        """Begin the next segment with a line; where the old one cannot have its name, go on in it for another length.

        Raises:
            OSError: the next segment cannot be made.
        """
        try:
            self._archive()
        except OSError:
            self._full_bytes += self._segment_bytes
        else:
            self.begin(line)

    def begin(self, line: bytes) -> Segment:
        """Make the segment that begins with a line, even if the one before failed.

        Raises:
            OSError: it cannot be made.
        """
        self.close()
        if not self._folder.is_dir():  # somebody has deleted it, or the disk took none before
            self._folder.mkdir(parents=True, exist_ok=True)
            sync_folder(self._folder.parent)
        self._archive()
        number = self._number + 1
        segment = self._make(number, sealed_at(line, self._header(number)))
        self._delete_oldest()
        return segment

    def close(self) -> None:
        """Close the newest segment; safe twice."""
        if self.newest is not None:
            self.newest.close()
            self.newest = None

    def _make(self, number: int, header: bytes) -> Segment:
        self.newest = self._latest = Segment(self._folder / FILE_NAME, header)
        self._number = number
        self._empty_bytes = self.newest.size
        self._full_bytes = self._segment_bytes
        return self.newest

    def _archive(self) -> None:
        """Make room for a new segment: the old one gets its number as a name, unless there is nothing in it."""
        newest = self._folder / FILE_NAME
        if not newest.exists():
            return
        if newest.stat().st_size <= self._empty_bytes:
            newest.unlink()  # or a disk that fails each second would leave a file each second
            self._number -= 1
            return
        while segment_path(self._folder, self._number).exists():
            self._number += 1
        newest.rename(path := segment_path(self._folder, self._number))
        if self._latest is not None and not self._latest.drove:
            self._idle.add(path)

    def _delete_oldest(self) -> None:
        """Delete segments but the first, until the run and another full one fit into its limit.

        Those in which no wheel turned go first, then the oldest: a rover that stands disarmed for days must not lose
        the log of its missions for that.
        """
        with suppress(OSError):
            sizes = {path: path.stat().st_size for path in older_segments(self._folder)}
            for path in sorted(list(sizes)[1:], key=lambda path: path not in self._idle):
                if sum(sizes.values()) + self._segment_bytes <= self._run_bytes:
                    break
                path.unlink()
                self._idle.discard(path)
                del sizes[path]
