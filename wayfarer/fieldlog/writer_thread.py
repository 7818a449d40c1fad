"""A thread between the event loop and the disk, so that a slow disk does not delay the control tick."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count

from wayfarer.fieldlog.disk import DRIVES_ON
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.writer import RunFiles
from wayfarer.waiting_thread import WaitingThread

WRITE_S = 0.2  # what a killed process can lose; a power cut takes what was written since the last sync
WRITES_A_SYNC = 5  # so that each second, and whatever was written at once, is on the disk
QUEUE_BYTES = 4_000_000  # at 14 kB a second, nearly five minutes of a disk that does not answer
URGENT_BYTES = 1_000_000  # beyond them, for urgent lines only
CLOSE_S = 1.0  # how long the end of a run waits for the disk

QueuedLine = tuple[bytes, bool, int]  # a line, whether it is urgent, and how many before it found no room


class WriterThread(WaitingThread):
    """Queues the lines of a log and has a thread write them to its files.

    ``bulk`` and ``urgent`` only append to the queue, from any thread: no lock that they take is held over a transfer.
    What the queue cannot hold is dropped and counted, and the log says where.

    Args:
        files: writes the lines; it belongs to the thread from ``open`` on.
        queue_bytes: how much may wait.
    """

    def __init__(self, files: RunFiles, queue_bytes: int = QUEUE_BYTES) -> None:
        super().__init__("field log")
        self._files = files
        self._queue_bytes = queue_bytes
        self._queue: list[QueuedLine] = []
        self._waiting = self._waiting_bytes = 0  # what was taken and is not written yet
        self._gap = 0  # lines that were dropped and that no queued line tells of yet
        self._refused = 0  # lines that never came to the files
        self._hurry = False

    @property
    def dropped(self) -> int:
        """How many lines could not be written."""
        return self._refused + self._files.dropped

    @property
    def trouble(self) -> str | None:
        """Why records are lost at present, None if they are not."""
        return self._files.trouble.now

    def take_slowest_sync_s(self) -> float:
        """Return the longest time that the disk has taken to store records since this was asked last, in seconds."""
        slowest_s, self._files.slowest_sync_s = self._files.slowest_sync_s, 0.0
        return slowest_s

    def open(self, header: Callable[[int], Record]) -> None:
        """Make the files, which may wait for the disk, and start the thread; see ``RunFiles``.

        A rover drives on without a log, so it also begins without one where the disk takes none.
        """
        self._files.open(header, needed=False)
        with self._changed:
            self._wake()

    def bulk(self, line: bytes) -> None:
        """Queue a line of a frequent kind."""
        self._put(line, self._queue_bytes, urgent=False)

    def urgent(self, line: bytes) -> None:
        """Queue a line that must be on the disk soon, and wake the thread."""
        self._put(line, self._queue_bytes + URGENT_BYTES, urgent=True)

    def close(self) -> None:
        """Have everything written, as far as the disk takes it within ``CLOSE_S``. Safe twice."""
        self._close()
        self._join(CLOSE_S)
        with self._changed:
            left, self._waiting = self._waiting, 0
            self._refused += left
        if left:
            text = f"the disk did not take the end of the field log: its last {left} records may be missing"
            self._files.trouble.begins("end", text)

    def _put(self, line: bytes, limit_bytes: int, *, urgent: bool) -> None:
        with self._changed:
            full = self._waiting_bytes + len(line) > limit_bytes
            if full or self._closed:
                self._gap += 1
                self._refused += 1
            else:
                self._queue.append((line, urgent, self._gap))
                self._gap = 0
                self._waiting += 1
                self._waiting_bytes += len(line)
                if urgent:
                    self._hurry = True
                    self._changed.notify()
        if full:
            text = "the field log cannot be written: the disk does not answer (see dmesg)"
            self._files.trouble.begins("queue", f"{text}{DRIVES_ON}")

    def _work(self) -> None:
        for turn in count(1):
            queued, last = self._take()
            try:
                self._write(queued)
                if last:
                    self._files.close()
                elif turn % WRITES_A_SYNC == 0:
                    self._files.sync()
                else:
                    self._files.flush()
            except Exception:  # an error inside wayfarer costs these lines; a log without a writer would cost all
                self._files.lose(len(queued))
            self._forget(queued)
            if self._waiting_bytes <= self._queue_bytes // 2:
                self._files.trouble.ends("queue", self.dropped)
            if last:
                return

    def _take(self) -> tuple[list[QueuedLine], bool]:
        """Wait for the next time to write; return what is queued, and whether nothing can come any more."""
        with self._changed:
            self._changed.wait_for(lambda: self._hurry or self._closed, WRITE_S)
            queued, self._queue, self._hurry = self._queue, [], False
            return queued, self._closed

    def _write(self, queued: list[QueuedLine]) -> None:
        for line, urgent, gap in queued:
            self._files.tell_of_gap(gap)
            if urgent:
                self._files.urgent(line)
            else:
                self._files.bulk(line)

    def _forget(self, queued: list[QueuedLine]) -> None:
        with self._changed:
            self._waiting = max(0, self._waiting - len(queued))
            self._waiting_bytes -= sum(len(line) for line, _, _ in queued)
