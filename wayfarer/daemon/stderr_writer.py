"""Writes lines for the terminal or the journal in a thread, so that the event loop never waits for them.

A stderr that nobody reads (a stalled ssh, Ctrl-S, a journal that hangs) blocks every thread that writes to it, without
a limit. So lines are queued, and a separate thread writes them. Lines that do not fit are lost, and their number is
written later.
"""

from __future__ import annotations

import os
import sys
from collections import deque
from contextlib import suppress

from wayfarer.waiting_thread import WaitingThread

LINES = 200  # queued at most: some minutes of a rover that drives
CLOSE_S = 0.2  # how long the end of a run waits for what is queued


class StderrWriter(WaitingThread):
    """Writes lines to stderr from any thread, without waiting or raising; its thread begins with the first line.

    After the first lost line all further ones are lost until the queue is written; then one line says how many.
    """

    def __init__(self) -> None:
        super().__init__("line writer")
        self._queue: deque[str] = deque()
        self._lost = 0

    def write(self, text: str) -> None:
        """Write a line soon. It is lost if too many are queued, if there is no stderr, and after ``close``."""
        with self._changed:
            if self._lost or len(self._queue) >= LINES:
                self._lost += 1
                return
            self._queue.append(text)
            with suppress(RuntimeError):  # no thread can be started now: the next line tries again
                self._wake()

    def close(self) -> None:
        """Write the queued lines and end the writer; waits at most ``CLOSE_S``. Safe twice."""
        self._close()
        self._join(CLOSE_S)

    def _work(self) -> None:
        while (line := self._next()) is not None:
            _write(line)

    def _next(self) -> str | None:
        """Wait for a line; None when the writer is closed and nothing is left."""
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._lost or self._closed)
            if self._queue:
                return self._queue.popleft()
            lost, self._lost = self._lost, 0
            return f"… {lost} lines lost" if lost else None


def _write(line: str) -> None:
    """Write to the file itself: a thread that waits in ``sys.stderr`` holds its lock, and then Python cannot exit."""
    with suppress(OSError, ValueError, AttributeError):  # nobody reads it any more, or there is no stderr
        data = f"{line}\n".encode(errors="backslashreplace")
        while data:
            data = data[os.write(sys.stderr.fileno(), data) :]
