"""Paces a task on a fixed time grid; and limits how often a request is accepted."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, Final

from mypy_extensions import mypyc_attr

# A person may send some requests quickly; a script in an endless loop is limited to 2 records per second.
ASKED_AT_ONCE: Final = 5
ASKED_HZ: Final = 2.0


@mypyc_attr(allow_interpreted_subclasses=True)
class Clock:
    """The time of an event loop, and what wakes its tasks; the loop of the simulation has a faster one as ``clock``."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop

    def time(self) -> float:
        """Return the loop's time in seconds."""
        return self.loop.time()

    def wake(self, rate: Rate, work: AtOnce | None) -> Awaitable[None]:  # noqa: ARG002 - tasks do their work themselves
        """Return what is done at the next time of a grid; see ``Rate.wait``."""
        wake_up: asyncio.Future[None] = self.loop.create_future()
        self.loop.call_at(rate.next_s(), _wake, wake_up)
        return wake_up


def _wake(wake_up: asyncio.Future[None]) -> None:
    if not wake_up.done():  # cancelled with its task
        wake_up.set_result(None)


@mypyc_attr(allow_interpreted_subclasses=True)
class AtOnce:
    """What a task does at each time of its grid, if nothing in it waits: the simulation then need not wake the task."""

    def at_once(self, clock: Clock) -> bool:
        """Do it at the clock's time, in no task; return False if the task must go on itself.

        An error is raised in the task, where it waits for its rate.
        """
        raise NotImplementedError


def without_waiting(part: object, name: str) -> Callable[..., Any] | None:
    """Return the method of a part that does the same as the coroutine ``name`` and never waits, None without one.

    It is ``read_without_waiting`` beside ``read``, and is given the time of now. It counts only in the class that has
    the coroutine: one that inherits from it, or wraps it, may do more.
    """
    immediate = f"{name}_without_waiting"
    for kind in type(part).__mro__:
        if name in vars(kind):
            return getattr(part, immediate) if immediate in vars(kind) else None
    return None


class Rate:
    """Wakes its task at every period from now on; periods that were missed are skipped.

    An old sample is useless, and a late tick must not be followed by a burst of ticks. The grid does not drift: a late
    wake-up does not shift the next one, unless it was late by a whole period; then the grid restarts.
    """

    def __init__(self, rate_hz: float) -> None:
        loop = asyncio.get_running_loop()
        clock = getattr(loop, "clock", None)
        self._clock = clock if isinstance(clock, Clock) else Clock(loop)
        self._period_s = 1.0 / rate_hz
        self._start_s = self._clock.time()
        self._count = 0.0

    def wait(self, work: AtOnce | None = None) -> Awaitable[None]:
        """Return an awaitable that is done at the next grid time; await it at once.

        In the simulation ``work`` is done at that time and at those after it, until that is not possible at once: then
        the awaitable is done. Elsewhere it is the task that does it.
        """
        return self._clock.wake(self, work)

    def next_s(self) -> float:
        """Go on to the next grid time, and return it."""
        self._count += 1.0
        # A multiple of the period, not a sum of periods: rounding errors must not separate tasks that are due together.
        due_s = self._start_s + self._count * self._period_s
        now_s = self._clock.time()
        if due_s < now_s:
            self._start_s, self._count, due_s = now_s, 0.0, now_s
        return due_s


class RateLimiter:
    """Limits how often something may be done: ``most`` times at once, on average ``rate_hz`` times per second. Pure."""

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
