"""Threads for work that must not delay the event loop: transfers on a bus, writing a log, printing, a look at a disk.

All are daemon threads, so that the process can end while a call hangs in the kernel.
"""

from __future__ import annotations

import _thread
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class WaitingThread(ABC):
    """A thread that waits for work; it begins with the first ``_wake``.

    Everything that it shares with other threads is read and changed while ``_changed`` is held.
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


class OneCall:
    """A call in a thread, only one at a time, begun on the loop even if memory is short: ``start`` waits for nothing.

    What is begun while the call is under way is done once more after it. So a disk that hangs holds one thread, however
    often it is asked. If no memory is left, a thread can end before its first line, and ``threading.Thread.start``
    waits for ever then.
    """

    def __init__(self, call: Callable[[], object]) -> None:
        self._call = call
        self._changed = threading.Condition()
        self._wanted = self._runs = False

    def start(self) -> None:
        """Begin the call, or have it done once more.

        Raises:
            RuntimeError: no thread can be had.
        """
        with self._changed:
            if not self._runs:
                _thread.start_new_thread(self._run, ())  # it waits here for the next line
            self._wanted = True

    def _run(self) -> None:
        while self._take():
            try:
                self._call()
            finally:
                with self._changed:
                    self._runs = False
                    self._changed.notify_all()

    def _take(self) -> bool:
        with self._changed:
            takes = self._wanted and not self._runs
            if takes:
                self._runs, self._wanted = True, False
            return takes

    @property
    def is_over(self) -> bool:
        """Whether no call is under way."""
        return not (self._runs or self._wanted)

    def join(self, wait_s: float | None = None) -> None:
        """Wait until no call is under way, at most ``wait_s``."""
        with self._changed:
            self._changed.wait_for(lambda: self.is_over, wait_s)


def answer_within(wait_s: float, call: Callable[[], T], otherwise: T) -> T:
    """Return what a call returns, or ``otherwise`` if that takes longer: it may hang for ever.

    Raises:
        Exception: what the call raises.
    """
    answers: list[T] = []
    errors: list[Exception] = []

    def work() -> None:
        try:
            answers.append(call())
        except Exception as error:
            errors.append(error)

    thread = OneCall(work)
    thread.start()
    thread.join(wait_s)
    if errors:
        raise errors[0]
    return answers[0] if answers else otherwise
