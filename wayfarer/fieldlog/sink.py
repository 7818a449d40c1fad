"""The sink of a run's log: a bounded queue of lines, and the files on the disk that take them.

The files of a run are its parts: ``run.00001.jsonl``, ``run.00002.jsonl`` and so on. Each begins with the header, so
that it can be read alone, and none is ever renamed. On a rover a thread writes them, so that no disk delays the control
tick; a simulated trial writes them in its own thread, and the same trial gives the same bytes.

A disk may be full, slow, frozen, read-only, or fail in any other way: nothing is raised into control. Lines wait in the
queue until the disk takes them; what finds no room there is dropped and counted, which a reader sees by the numbers of
the records, and a person is told.
"""

from __future__ import annotations

import errno
import fcntl
import os
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import count, islice
from math import inf
from pathlib import Path

from wayfarer.config.rover_file import UNLIMITED, LogSettings
from wayfarer.errors import BadInput
from wayfarer.fieldlog.folders import MB, error_advice, part_name, part_names
from wayfarer.files import open_folder, sync_folder
from wayfarer.waiting_thread import WaitingThread

WRITE_S = 0.18  # between two writes: a killed process loses at most 0.2 s
WRITES_A_SYNC = 5  # between two syncs: a power cut loses at most a second
RETRY_S = 1.0  # until a disk that failed is asked again
OPEN_S, CLOSE_S = 1.0, 1.0  # how long the begin and the end of a run wait for the disk
SILENT_S = 5.0  # until a person is told; a card pauses for half a second (docs/reference/hardware.md)
BATCH = 256  # lines, written with one call
QUEUE_BYTES = 4_000_000  # at 14 kB per second, nearly five minutes of a disk that takes nothing
URGENT_BYTES = 1_000_000  # beyond them, for urgent lines only
RELIEF = 1.1  # so much more than ``free_mb`` must be free before ticks are written again
# O_EXCL makes a new file: nothing is written over, and no symlink is followed. O_APPEND: if anything else happens to
# the file, a line never lands in the middle of it.
NEW_FILE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_APPEND | os.O_CLOEXEC


class Parts:
    """The files of one run. Any method may wait for the disk and raise ``OSError``; not for two threads at once.

    The folder is held by its descriptor: what somebody else puts in its place gets no line.

    Args:
        folder: the run's folder; made if it is not there.
        settings: limits in size.
        warn: takes a line for the person.
    """

    def __init__(self, folder: Path, settings: LogSettings, warn: Callable[[str], None]) -> None:
        self.header: Callable[[int], bytes] = lambda _: b""
        self._path, self._warn = folder, warn
        self._real: Path | None = None  # the path, without symlinks
        self._part_bytes, self._run_bytes = settings.part_mb * MB, settings.run_mb * MB
        self._folder = self._file = -1
        self._number = self._size = 0
        self._fit = self._torn = False
        self._empty: os.stat_result | None = None  # what the newest part is, if there is only the header in it

    def append(self, lines: Sequence[bytes]) -> int:
        """Write lines, in a new part if need be; return how many went in whole. Without lines only the part is made."""
        full = self._size + sum(map(len, lines)) + len(lines) > self._part_bytes
        if not self._fit or (full and self._empty is None):
            try:
                self._begin()
            except OSError:
                self._close_folder()  # next time it is looked up by its path: the disk there may be another one
                if self._file < 0:
                    raise  # else the part before goes on: a disk may take lines and no new file
        if not lines:
            return 0
        torn, self._fit = self._torn, False
        data = b"\n" * torn + b"".join(line + b"\n" for line in lines)
        if not (done := os.write(self._file, data)):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        self._fit, self._size, self._torn = True, self._size + done, not data.endswith(b"\n", 0, done)
        whole = data.count(b"\n", 0, done + 1) - torn  # a line of which only the end is missing gets it next time
        self._empty = None if whole else self._empty
        return whole

    def sync(self) -> None:
        """Return when all is on the disk. After an error, or if the file was deleted, the next line begins a part."""
        try:
            os.fdatasync(self._file)
            if not os.fstat(self._file).st_nlink:
                raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))
        except OSError:
            self._close_file()
            raise

    def free_mb(self) -> float:
        """Return how much may still be written to the disk."""
        stated = os.fstatvfs(self._file)
        return stated.f_bavail * stated.f_frsize / MB

    def close(self) -> None:
        """Close what is open; safe twice."""
        self._close_file()
        self._close_folder()

    def _begin(self) -> None:
        """Begin the next part. If that fails, nothing is left of it, and the part before is as it was."""
        self._hold_folder()
        number = self._number + 1
        try:
            file = os.open(part_name(number), NEW_FILE, 0o644, dir_fd=self._folder)
        except FileExistsError:  # somebody else's: the next try takes the next number
            self._number = number
            raise
        try:
            header = self.header(number) + b"\n"
            if os.write(file, header) < len(header):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fdatasync(file)
        except BaseException:
            os.close(file)
            with suppress(OSError):
                os.unlink(part_name(number), dir_fd=self._folder)
            raise
        with suppress(OSError):  # some file systems cannot do that
            os.fsync(self._folder)
        if self._file >= 0:
            with suppress(OSError):
                os.fdatasync(self._file)
        if self._empty is not None:  # or a disk that takes headers only would have one more each second
            with suppress(OSError):
                name = part_name(self._number)
                if os.path.samestat(self._empty, os.stat(name, dir_fd=self._folder, follow_symlinks=False)):
                    os.unlink(name, dir_fd=self._folder)
        self._close_file()
        self._file, self._number, self._size = file, number, len(header)
        self._fit, self._torn, self._empty = True, False, os.fstat(file)
        self._delete_oldest()

    def _hold_folder(self) -> None:
        if self._folder < 0:
            if self._real is None:  # what symlinks there are on the way is a person's choice now, and nobody's later
                self._real = Path(os.path.realpath(self._path.parent)) / self._path.name
            self._folder = open_folder(self._real)
            try:
                fcntl.flock(self._folder, fcntl.LOCK_SH | fcntl.LOCK_NB)  # ``retention`` deletes no run with a lock
            except BlockingIOError:
                pass  # another program looks whether it may delete this run: not while it is the newest
            except OSError as error:
                text = "no lock keeps other programs from deleting this run while it is written"
                self._warn(f"{self._path}: {text}: {error.strerror}")
            sync_folder(self._real.parent)

    def _delete_oldest(self) -> None:
        """Delete parts, the oldest first but never the first, until another full one fits into the run's limit."""
        if self._run_bytes < inf:
            with suppress(OSError):
                names = part_names(self._folder)
                sizes = [os.stat(name, dir_fd=self._folder, follow_symlinks=False).st_size for name in names]
                beyond = sum(sizes) + self._part_bytes - self._run_bytes
                for name, size in list(zip(names, sizes, strict=True))[1:-1]:
                    if beyond > 0:
                        os.unlink(name, dir_fd=self._folder)
                        beyond -= size

    def _close_file(self) -> None:
        file, self._file, self._fit = self._file, -1, False
        with suppress(OSError):  # none is open
            os.close(file)

    def _close_folder(self) -> None:
        folder, self._folder = self._folder, -1
        with suppress(OSError):
            os.close(folder)


class Sink(WaitingThread):
    """Takes the lines of a run; ``put`` never raises, and does not wait for the disk if a thread writes.

    ``dropped`` counts the lines that are lost; ``trouble`` says why lines wait or are lost at present.

    Args:
        folder: the run's folder; made if it is not there.
        settings: limits in size.
        tell: prints a line for the person when the log has trouble, and when it is over; must not wait.
        clock: gives seconds, to any thread; without it only the caller's thread writes, as in a simulated trial.
        queue_bytes: how much may wait.
    """

    def __init__(
        self,
        folder: Path,
        settings: LogSettings = UNLIMITED,
        tell: Callable[[str], None] = lambda _: None,
        clock: Callable[[], float] | None = None,
        queue_bytes: int = QUEUE_BYTES,
    ) -> None:
        super().__init__("field log")
        self.dropped = 0
        self.trouble: str | None = None
        self._folder, self._free_mb = folder, settings.free_mb
        self._parts = Parts(folder, settings, self._tell_once)
        self._tell, self._clock, self._threaded = tell, clock or (lambda: 0.0), clock is not None
        self._queue: deque[bytes] = deque()
        self._most_bytes, self._queued_bytes = queue_bytes, 0
        self._hurry = self._scarce = False
        self._well: bool | None = None  # whether the disk took what it was given last; None before that
        self._told: set[str] = set()
        self._unsynced = self._dropped_before = 0
        self._asked_s = inf  # since when the disk is being waited for
        self._slowest_s = 0.0

    def open(self, header: Callable[[int], bytes]) -> None:
        """Begin the log; ``header`` gives the first line of each part, by its number from 1, without its end.

        A rover drives on without a log, so it also begins if the disk takes none. A trial must have one.

        Raises:
            BadInput: a trial's log cannot be made, or one is there.
        """
        self._parts.header = header
        if self._threaded:
            with self._changed:
                self._wake()
                self._changed.wait_for(lambda: self._well is not None, OPEN_S)
            return
        try:
            if self._folder.is_dir() and part_names(self._folder):
                raise OSError(errno.EEXIST, os.strerror(errno.EEXIST))
            self._parts.append(())
        except OSError as error:
            raise BadInput(f"{self._folder}: the field log cannot be written: {error_advice(error)}") from None

    def put(self, line: bytes, urgent: bool = False) -> None:
        """Take a line without its end. An urgent one is on the disk soon, and is dropped last."""
        most = self._most_bytes + (URGENT_BYTES if urgent else 0)
        with self._changed:
            full = self._queued_bytes + len(line) > most
            if full or self._closed or (self._scarce and not urgent):
                self.dropped += 1
            else:
                self._queue.append(line)
                self._queued_bytes += len(line)
                if urgent:
                    self._hurry = True
                    self._changed.notify_all()
        if not self._threaded:
            if not self._closed and (urgent or len(self._queue) >= BATCH):
                self._store(sync=False)
        elif (full or self._clock() - self._asked_s > SILENT_S) and self.trouble is None:
            self._begin_trouble("the field log cannot be written: the disk does not answer (see dmesg)")

    def take_slowest_sync_s(self) -> float:
        """Return the longest time that the disk has taken to store records since this was asked last, in seconds."""
        slowest_s, self._slowest_s = self._slowest_s, 0.0
        return slowest_s

    def close(self) -> None:
        """Have everything written, as far as the disk takes it within ``CLOSE_S``. Safe twice."""
        first = not self._closed
        self._close()
        if self._threaded:
            self._join(CLOSE_S)
        elif first:
            self._store(sync=True)
            self._parts.close()
        with self._changed:
            left = len(self._queue)
            self._queue.clear()
            self.dropped += left
        if left:
            self._tell_once(f"the end of the field log could not be written: its last {left} records may be missing")

    # -- writing, in the thread if there is one ------------------------------------------------------------------------

    def _work(self) -> None:
        closed = hurry = False
        for turn in count():
            self._store(sync=closed or hurry or not self._well or turn % WRITES_A_SYNC == 0)
            if closed:
                self._parts.close()
                return
            with self._changed:
                wait_s = WRITE_S if self._well else RETRY_S
                self._changed.wait_for(lambda: self._closed or (self._well and self._hurry), wait_s)
                closed, hurry, self._hurry = self._closed, self._hurry, False

    def _store(self, *, sync: bool) -> None:
        """Write what is queued. What the disk does not take stays in the queue."""
        well, batch = False, None
        self._asked_s = self._clock()
        try:
            while batch != ():
                with self._changed:
                    batch = tuple(islice(self._queue, BATCH))
                written = self._parts.append(batch)
                with self._changed:
                    for _ in range(min(written, len(self._queue))):  # ``close`` may have given up and emptied it
                        self._queued_bytes -= len(self._queue.popleft())
                    self._unsynced += written
            if sync:
                self._sync()
            well = True
        except Exception as error:  # an error inside wayfarer, too, must not end the log
            why = error_advice(error) if isinstance(error, OSError) else repr(error)
            self._begin_trouble(f"{self._folder}: the field log cannot be written: {why}")
        self._asked_s = inf
        with self._changed:
            self._well = well
            self._changed.notify_all()

    def _sync(self) -> None:
        """Have everything on the disk: what could not be is lost, even if some of it should turn up later."""
        began_s, unsynced, self._unsynced = self._clock(), self._unsynced, 0
        try:
            self._parts.sync()
        except OSError:
            with self._changed:
                self.dropped += unsynced
            raise
        self._slowest_s = max(self._slowest_s, self._clock() - began_s)
        self._scarce = self._parts.free_mb() < self._free_mb * (RELIEF if self._scarce else 1.0)
        if self._scarce:
            text = f"the field log records only events and positions: less than {self._free_mb:g} MB are free"
            self._begin_trouble(f"{self._folder}: {text}: delete old runs")
        elif self.trouble is not None:
            self.trouble = None
            self._told.clear()
            self._tell(f"the field log is written again; records missing: {self.dropped - self._dropped_before}")
            self._dropped_before = self.dropped

    # -- what a person is told -----------------------------------------------------------------------------------------

    def _begin_trouble(self, text: str) -> None:
        self.trouble = text
        self._tell_once(f"{text}; the rover drives on")

    def _tell_once(self, text: str) -> None:
        """Print a text; again only after all was well."""
        with self._changed:
            new = text not in self._told
            self._told.add(text)
        if new:
            self._tell(text)
