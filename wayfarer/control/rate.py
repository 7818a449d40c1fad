"""Paces a task on a fixed time grid; and limits how often a request is accepted."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Final

# A person may send some requests quickly; a script in an endless loop is limited to 2 records a second.
ASKED_AT_ONCE: Final = 5
ASKED_HZ: Final = 2.0


class Rate:
    """Wakes its task at every period from now on; periods that were missed are skipped.

    An old sample is useless, and a late tick must not be followed by a burst of ticks. The grid does not drift: a late
    wake-up does not shift the next one, unless it was late by a whole period; then the grid restarts.
    """

    def __init__(self, rate_hz: float) -> None:
        loop = asyncio.get_running_loop()
        self._time = loop.time
        # The loop of the simulation has a faster way to do the same.
        self._wake_at: Callable[[float], Awaitable[None]] = getattr(loop, "wake_at", partial(_wake_at, loop))
        self._period_s = 1.0 / rate_hz
        self._start_s = loop.time()
        self._count = 0

    def wait(self) -> Awaitable[None]:
        """Return an awaitable that is done at the next grid time; await it at once."""
        self._count += 1
        # A multiple of the period, not a sum of periods: rounding errors must not separate tasks that are due together.
        due_s = self._start_s + self._count * self._period_s
        now_s = self._time()
        if due_s < now_s:
            self._start_s, self._count, due_s = now_s, 0, now_s
        return self._wake_at(due_s)


def _wake_at(loop: asyncio.AbstractEventLoop, when_s: float) -> asyncio.Future[None]:
    """Return a future that is done at a time of the loop."""
    wake_up: asyncio.Future[None] = loop.create_future()
    loop.call_at(when_s, _wake, wake_up)
    return wake_up


def _wake(wake_up: asyncio.Future[None]) -> None:
    if not wake_up.done():  # cancelled with its task
        wake_up.set_result(None)


class RateLimiter:
    """Limits how often something may be done: ``most`` times at once, on average ``rate_hz`` times a second. Pure."""

    def __init__(self, most: int = ASKED_AT_ONCE, rate_hz: float = ASKED_HZ) -> None:
        self._most = most
        self._rate_hz = rate_hz
        self._left = float(most)
        self._at_s: float | None = None

    def take(self, now_s: float) -> bool:
        """Return whether it may be done now, and count it if it may. ``now_s`` never goes back."""
        if self._at_s is not None:
            self._left = min(self._most, self._left + (now_s - self._at_s) * self._rate_hz)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
