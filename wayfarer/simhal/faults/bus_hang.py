"""A hanging bus, as a driver sees it through the worker thread (``drivers.threaded``)."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

from wayfarer.drivers.threaded import POSTED_MAX, TRANSFER_DEADLINE_S
from wayfarer.errors import NotResponding

T = TypeVar("T")


class Hang:
    """Carries transfers, or holds them up.

    The transfer that is under way when the bus hangs is done late, when it is back; its driver is told after the
    deadline that there was no answer, and every further one at once. Stops that were posted go first after that.
    """

    def __init__(self, name: str, deadline_s: float = TRANSFER_DEADLINE_S) -> None:
        self._name = name
        self._deadline_s = deadline_s
        self._hangs = False
        self._under_way: Callable[[], Any] | None = None
        self._posted: deque[Callable[[], Any]] = deque(maxlen=POSTED_MAX)
        self._back = asyncio.Event()

    def begin(self) -> None:
        """Hold the bus."""
        self._hangs = True
        self._back.clear()

    def end(self) -> None:
        """Let go of it: first what was under way is done, then what was posted."""
        self._hangs = False
        late, self._under_way = self._under_way, None
        for job in (late, *self._posted):
            if job is not None:
                with suppress(NotResponding):
                    job()
        self._posted.clear()
        self._back.set()

    async def carry(self, job: Callable[[], T]) -> T:
        """Do a transfer.

        Raises:
            NotResponding: the bus hangs for longer than a transfer's deadline.
        """
        if not self._hangs:
            return job()
        if self._under_way is not None:
            raise NotResponding(f"{self._name}: an earlier transfer still hangs; a device holds the bus")
        done: list[T] = []
        self._under_way = lambda: done.append(job())
        try:
            async with asyncio.timeout(self._deadline_s):
                await self._back.wait()
        except TimeoutError:
            raise NotResponding(f"{self._name}: a transfer did not end within {self._deadline_s:g} s") from None
        if not done:
            raise NotResponding(f"{self._name}: no answer")
        return done[0]

    def post(self, job: Callable[[], Any]) -> None:
        """Do a transfer without waiting; it goes first when the bus is back."""
        if self._hangs:
            self._posted.append(job)
        else:
            with suppress(NotResponding):
                job()
