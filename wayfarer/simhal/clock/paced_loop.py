"""A virtual loop at a pace, for people who look on: its time goes no faster than they want, and may stand still.

What runs on it runs exactly as on ``VirtualLoop``, because the pace only decides how long its thread waits between
two virtual times. Other threads may call into it with ``call_soon_threadsafe``, also while it waits.
"""

from __future__ import annotations

from asyncio import AbstractEventLoop
from collections.abc import Callable
from contextvars import Context, copy_context
from dataclasses import dataclass
from functools import partial
from math import inf
from queue import Empty, SimpleQueue
from time import monotonic  # noqa: TID251 - the clock that the pace is measured with
from typing import TypeVarTuple, Unpack

from wayfarer.simhal.clock.schedule import Fails, Handle, Schedule, Scheduled
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

Ts = TypeVarTuple("Ts")

CATCH_UP_S = 0.05  # of the clock: a delay that is made up for afterwards; a longer one was no hiccup


@dataclass(slots=True)
class Pace:
    """How many times faster than the clock virtual time goes, above 0, and whether it stands still.

    Any thread may change it. A loop that waits takes notice when it is woken: ``PacedLoop.wake``.
    """

    speed: float
    paused: bool = False


class PacedSchedule(Schedule):
    """Waits before it jumps to the next timer, and runs what other threads have sent meanwhile."""

    def __init__(self, pace: Pace, inbox: SimpleQueue[Scheduled], loop: AbstractEventLoop, fails: Fails) -> None:
        super().__init__(loop, fails)
        self._pace = pace
        self._inbox = inbox
        self._reached_s = monotonic()  # when the clock should have reached the present virtual time

    def _jump(self) -> bool:
        """Take what another thread has sent, or move to the next timer when the clock has come to it."""
        next_s = next((timer.when_s for timer in self._timers if not timer.is_cancelled), inf)
        if next_s == inf:
            return super()._jump()  # which ends the run: nothing would ever happen again
        due_s = self._reached_s + max(0.0, next_s - self._now_s) / self._pace.speed
        try:
            timeout_s = None if self._pace.paused else max(0.0, due_s - monotonic())
            self.soon(self._inbox.get(timeout=timeout_s))
        except Empty:
            self._reached_s = max(due_s, monotonic() - CATCH_UP_S)
            return super()._jump()
        return True


class PacedLoop(VirtualLoop):
    """A virtual loop with a pace, which other threads may call into."""

    def __init__(self, pace: Pace) -> None:
        self._inbox: SimpleQueue[Scheduled] = SimpleQueue()
        super().__init__(partial(PacedSchedule, pace, self._inbox))

    def call_soon_threadsafe(  # type: ignore[override]
        self, callback: Callable[[Unpack[Ts]], object], *args: Unpack[Ts], context: Context | None = None
    ) -> Handle:
        """Run the callback at the present virtual time, after what is ready; any thread may call this."""
        handle = Handle(callback, args, copy_context() if context is None else context)
        self._inbox.put(handle)
        return handle

    def wake(self) -> None:
        """Have a loop that waits look at its pace; any thread may call this."""
        self.call_soon_threadsafe(lambda: None)
