"""Worker thread of a bus: a hanging bus does not block the event loop.

Every call on a real bus blocks, for a second and more if a wire is loose, and cannot be interrupted. So each bus has
one thread, which does its transfers one after the other, and each transfer has a deadline. A transfer that misses it
raises ``NotResponding``; until the call in the thread returns, every further transfer is refused at once. A queued
transfer that has not begun within its deadline is dropped, because an old drive command must never reach the wheels
late, also not after the process was suspended. Posted stops are kept, and are sent first.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Any, TypeVar

from wayfarer.drivers.buses import CLOSE_WAIT_S
from wayfarer.errors import NotResponding
from wayfarer.waiting_thread import WaitingThread

T = TypeVar("T")

POSTED_MAX = 8  # stops that wait while a bus hangs; all stops are the same, so the newest ones are enough
TRANSFER_DEADLINE_S = 0.1  # a block read takes 3 ms at 100 kHz; the rover's boards stop the wheels after 0.25 s


class Worker(WaitingThread):
    """One thread that does blocking jobs one after the other, each with a deadline."""

    def __init__(self, name: str, deadline_s: float = TRANSFER_DEADLINE_S) -> None:
        super().__init__(f"bus {name}")
        self.name = name
        self._deadline_s = deadline_s
        self._jobs: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._posted: deque[Callable[[], Any]] = deque(maxlen=POSTED_MAX)
        self._busy = False
        self._overdue = False
        self._ended: Future[None] = Future()

    async def call(self, job: Callable[[], T], deadline_s: float | None = None) -> T:
        """Do a job in the thread and return its result.

        Raises:
            NotResponding: the deadline passed, or an earlier job has missed its own and still hangs.
        """
        deadline_s = self._deadline_s if deadline_s is None else deadline_s
        future: Future[T] = Future()
        clock = asyncio.get_running_loop().time  # any thread may read it
        begins_by_s = clock() + deadline_s

        def in_time() -> T:
            if clock() > begins_by_s:
                raise NotResponding(f"{self.name}: a transfer did not begin within {deadline_s:g} s, and was dropped")
            return job()

        with self._changed:
            if self._overdue or self._closed:
                raise NotResponding(
                    f"{self.name}: closed"
                    if self._closed
                    else f"{self.name}: an earlier transfer still hangs; a device holds the bus, check power and wiring"
                )
            self._jobs.append((in_time, future))
            try:
                self._wake()
            except RuntimeError as error:
                self._jobs.pop()
                raise NotResponding(f"{self.name}: {error}; the computer is out of threads or memory") from None
        try:
            async with asyncio.timeout(deadline_s) as deadline:
                return await asyncio.wrap_future(future)
        except TimeoutError:
            if not deadline.expired():
                raise  # the job's own error: a driver in the kernel timed out
            self._give_up()
            raise NotResponding(
                f"{self.name}: a transfer did not end within {deadline_s:g} s; a device holds the bus, "
                "check power and wiring"
            ) from None

    def post(self, job: Callable[[], Any]) -> None:
        """Do a job before all queued ones, from any thread, without waiting; its errors are ignored."""
        with self._changed:
            if not self._closed:
                self._posted.append(job)
                with suppress(RuntimeError):  # no thread can be started now: the next job tries again
                    self._wake()

    async def close(self, last: Callable[[], Any] | None = None, wait_s: float = CLOSE_WAIT_S) -> None:
        """Let the thread end after the posted jobs and ``last``; wait for it no longer than ``wait_s``."""
        with self._changed:
            if last is not None and self._thread is not None and not self._closed:
                self._posted.append(last)
            self._close()
        if self._thread is not None:
            with suppress(TimeoutError):
                async with asyncio.timeout(wait_s):
                    await asyncio.shield(asyncio.wrap_future(self._ended))

    def _give_up(self) -> None:
        """Drop all calls that wait behind a job that hangs: a call, an abandoned call, or a stop."""
        with self._changed:
            self._overdue = self._busy
            dropped, self._jobs = self._jobs, deque()
        for _, waiting in dropped:
            if waiting.set_running_or_notify_cancel():
                waiting.set_exception(NotResponding(f"{self.name}: an earlier transfer hangs"))

    def _work(self) -> None:
        while (next_job := self._next()) is not None:
            job, future = next_job
            if future is not None and not future.set_running_or_notify_cancel():
                continue
            try:
                result = job()
            except Exception as error:
                if future is not None:
                    future.set_exception(error)
            else:
                if future is not None:
                    future.set_result(result)
        self._ended.set_result(None)

    def _next(self) -> tuple[Callable[[], Any], Future[Any] | None] | None:
        """Wait for a job; None once the worker is closed and no posted job is left."""
        with self._changed:
            self._busy = self._overdue = False
            self._changed.wait_for(lambda: self._posted or self._jobs or self._closed)
            self._busy = True
            if self._posted:
                return self._posted.popleft(), None
            if self._closed:
                return None
            return self._jobs.popleft()
