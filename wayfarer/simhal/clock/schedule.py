"""What is due when on ``VirtualLoop``: the virtual time, the ready callbacks and the timers. Compiled with the core.

A task that ``Rate`` paces awaits a ``WakeUp``: a timer that is awaited like a future. At its time it does the work of
the task without waking it, if that never waits (``control.rate.AtOnce``). So a control tick over simulated parts
has no step of a task.
"""

from __future__ import annotations

from asyncio import AbstractEventLoop, CancelledError
from collections.abc import Callable, Generator
from contextvars import Context
from math import inf
from typing import Any

from mypy_extensions import mypyc_attr

from wayfarer.control.rate import AtOnce, Clock, Rate


class Scheduled:
    """Something to run at its turn, or not, if it is cancelled before. ``when_s`` is the time of a timer."""

    is_cancelled = False
    when_s = 0.0

    def run(self) -> None:
        """Do it."""
        raise NotImplementedError


class Handle(Scheduled):
    """A callback to run. Stands in for ``asyncio.Handle`` and ``asyncio.TimerHandle``."""

    def __init__(self, callback: Callable[..., object], args: tuple[Any, ...], context: Context) -> None:
        self._callback = callback
        self._args = args
        self._context = context

    def cancel(self) -> None:
        """Have it not run."""
        self.is_cancelled = True

    def cancelled(self) -> bool:
        """Return whether it was cancelled."""
        return self.is_cancelled

    def run(self) -> None:
        """Call it in its context."""
        if not self.is_cancelled:
            self._context.run(self._callback, *self._args)

    def __repr__(self) -> str:
        """Say what is called, for the report of an error."""
        return repr(self._callback)


class WakeUp(Scheduled):
    """A future without a result that is done at the next time of a grid; one task awaits it, at once.

    ``work`` is done at that time and at those after it, as long as that can be done at once; only then it is done. It
    has what ``asyncio.Task`` asks of a future that is not asyncio's own (see ``asyncio.isfuture``).
    """

    _asyncio_future_blocking = False
    _is_done = False
    _message: object = None
    _error: BaseException | None = None
    _callback: Callable[..., object] | None = None

    def __init__(self, schedule: Schedule, rate: Rate, work: AtOnce | None) -> None:
        self._schedule = schedule
        self._loop = schedule.loop
        self._rate = rate
        self._work = work

    def __await__(self) -> Generator[WakeUp, None, None]:
        """Wait for the time; ``result`` raises here what the work raised, or that the task was cancelled meanwhile."""
        self._asyncio_future_blocking = True
        yield self

    def add_done_callback(self, callback: Callable[..., object], *, context: Context) -> None:
        """Have the task woken that waits."""
        self._callback = callback
        self._context = context

    def cancel(self, msg: object = None) -> bool:
        """Wake the task now, with an error; return whether that was still possible."""
        self._work = None  # in any case the task must go on itself: to be cancelled
        if self._is_done:
            return False
        self._is_done = self.is_cancelled = True
        self._message = msg
        self._schedule.soon(self)
        return True

    def result(self) -> None:
        """Return nothing.

        Raises:
            CancelledError: the wait was cancelled.
            BaseException: what the work raised.
        """
        if self.is_cancelled:
            raise CancelledError() if self._message is None else CancelledError(self._message)
        if self._error is not None:
            raise self._error

    def run(self) -> None:
        """Be done at the first turn, and work or wake the task at the next: in the order of asyncio's own futures."""
        if not self._is_done:
            self._is_done = True
            self._schedule.soon(self)
            return
        work = self._work
        if work is not None and self._do(work):
            return
        callback = self._callback
        if callback is not None:  # only once: one that is cancelled late has two turns
            self._callback = None
            self._context.run(callback, self)

    def _do(self, work: AtOnce) -> bool:
        """Do the work, and wait for the next time of the grid; return False if the task must be woken."""
        try:
            if not work.at_once(self._schedule):
                return False
        except BaseException as error:
            self._error = error
            return False
        if self._work is None:  # the work has cancelled its own task: that comes at the next turn, as on the stock loop
            self._schedule.soon(self)
        else:
            self._is_done = False
            self._schedule.at(self._rate.next_s(), self)
        return True


Fails = Callable[[Scheduled, BaseException], None]


@mypyc_attr(allow_interpreted_subclasses=True)
class Schedule(Clock):
    """The virtual time, in seconds from 0, and what is to run.

    Args:
        loop: whose schedule it is.
        fails: is called with an error that comes out of what was run; SystemExit and KeyboardInterrupt end ``run``
        instead.
    """

    def __init__(self, loop: AbstractEventLoop, fails: Fails) -> None:
        super().__init__(loop)
        self._fails = fails
        self._now_s = 0.0
        self._ready: list[Scheduled] = []
        self._timers: list[Scheduled] = []  # by time, and if that is equal by creation
        self._stopping = False

    def time(self) -> float:
        """Return the virtual time in seconds."""
        return self._now_s

    def stall(self, for_s: float) -> None:
        """Let time pass in which nothing runs, as when a callback blocks or the computer was suspended."""
        self._now_s += for_s

    def soon(self, what: Scheduled) -> None:
        """Run it when its turn comes, at the present time."""
        self._ready.append(what)

    def at(self, when_s: float, what: Scheduled) -> None:
        """Run it at a time; at once, but never earlier than now, if that is past."""
        what.when_s = when_s
        timers = self._timers
        place = len(timers)
        while place and timers[place - 1].when_s > when_s:  # few are later: a heap would cost more
            place -= 1
            if timers[place].is_cancelled:  # no later one need pass it again
                timers.pop(place)
        timers.insert(place, what)

    def wake(self, rate: Rate, work: AtOnce | None) -> WakeUp:
        """Return what a task awaits at once, to be woken at the next time of a grid."""
        wake_up = WakeUp(self, rate, work)
        self.at(rate.next_s(), wake_up)
        return wake_up

    def clear(self) -> None:
        """Drop everything."""
        self._ready.clear()
        self._timers.clear()

    def stop(self) -> None:
        """Have ``run`` end after what runs now."""
        self._stopping = True

    def run(self) -> bool:
        """Run what is ready, in turn, and jump to the next timer when nothing is.

        Return True after ``stop``, False when nothing can ever happen again: nothing is ready, and there is no timer.
        """
        self._stopping = False
        while not self._stopping:
            if not self._ready and not self._jump():
                return False
            turn, self._ready = self._ready, []
            begun = 0
            try:
                for what in turn:
                    begun += 1
                    try:
                        what.run()
                    except (SystemExit, KeyboardInterrupt):
                        raise
                    except BaseException as error:
                        self._fails(what, error)
                    if self._stopping:
                        break
            finally:  # also if ``fails`` raises
                if begun < len(turn):
                    self._ready[:0] = turn[begun:]
        return True

    def _jump(self) -> bool:
        """Move the clock to the next timer, and make all ready that are due then; False without a timer."""
        timers = self._timers
        while timers and timers[0].is_cancelled:
            timers.pop(0)
        if not timers or timers[0].when_s == inf:
            return False
        self._now_s = now_s = max(timers[0].when_s, self._now_s)
        while timers and timers[0].when_s <= now_s:
            what = timers.pop(0)
            if not what.is_cancelled:
                self._ready.append(what)
        return True
