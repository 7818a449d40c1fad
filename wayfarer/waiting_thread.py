"""Base of the threads for work that must not delay the event loop: transfers on a bus, writing a log, printing."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod


class WaitingThread(ABC):
    """A thread that waits for work; it begins with the first ``_wake``.

    Everything that it shares with other threads is read and changed while ``_changed`` is held. It is a daemon thread,
    so that the process can end while a call hangs in the kernel.
    """

    def __init__(self, name: str) -> None:
        self._thread_name = name
        self._changed = threading.Condition()
        self._closed = False
        self._thread: threading.Thread | None = None

    @abstractmethod
    def _work(self) -> None:
        """Do the work until ``_closed``; runs in the thread."""

    def _wake(self) -> None:
        """Let the thread check for work; called while ``_changed`` is held."""
        if self._thread is None:
            thread = threading.Thread(target=self._work, name=self._thread_name, daemon=True)
            thread.start()
            self._thread = thread
        self._changed.notify()

    def _close(self) -> None:
        """Let the thread end once no work is left."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def _join(self, wait_s: float) -> None:
        """Wait until the thread has ended, at most ``wait_s``."""
        if self._thread is not None:
            self._thread.join(wait_s)
