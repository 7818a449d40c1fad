"""What is due when on ``VirtualLoop``: the virtual time, the ready callbacks and the timers. Compiled with the core.

A control tick has two and a half wake-ups of tasks. Each is a ``WakeUp``: a timer that a task awaits like a future, and
that wakes it without a callback of the loop in between.
"""

from __future__ import annotations

from asyncio import CancelledError
from collections.abc import Callable, Generator
from contextvars import Context
from math import inf
from typing import Any

from mypy_extensions import mypyc_attr


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
    """A future without a result that is done at a time; one task awaits it, at once.

    It has what ``asyncio.Task`` asks of a future that is not asyncio's own (see ``asyncio.isfuture``).
    """

    _asyncio_future_blocking = False
    _is_done = False
    _message: object = None
    _callback: Callable[..., object] | None = None

    def __init__(self, schedule: Schedule) -> None:
        self._schedule = schedule
        self._loop = schedule.loop

    def __await__(self) -> Generator[WakeUp, None, None]:
        """Wait for the time; a task that is cancelled meanwhile has ``result`` raise the error here."""
        self._asyncio_future_blocking = True
        yield self

    def add_done_callback(self, callback: Callable[..., object], *, context: Context) -> None:
        """Have the task woken that waits."""
        self._callback = callback
        self._context = context

    def cancel(self, msg: object = None) -> bool:
        """Wake the task now, with an error; return whether that was still possible."""
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
        """
        if self.is_cancelled:
            raise CancelledError() if self._message is None else CancelledError(self._message)

    def run(self) -> None:
        """Be done at the first turn, and wake the task at the next, in the order in which asyncio's futures would."""
        callback = self._callback
        if not self._is_done:
            self._is_done = True
            self._schedule.soon(self)
        elif callback is not None:  # only once: one that is cancelled late has two turns
            self._callback = None
            self._context.run(callback, self)


Fails = Callable[[Scheduled, BaseException], None]


@mypyc_attr(allow_interpreted_subclasses=True)
class Schedule:
    """The virtual time, in seconds from 0, and what is to run.

    Args:
        loop: whose schedule it is.
        fails: is told of an error that comes out of what was run; SystemExit and KeyboardInterrupt end ``run`` instead.
    """

    def __init__(self, loop: object, fails: Fails) -> None:
        self.loop = loop
        self._fails = fails
        self._now_s = 0.0
        self._ready: list[Scheduled] = []
        self._timers: list[Scheduled] = []  # by time, and where that is equal by creation
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
        """Run it at a time; at once, but never earlier than now, where that is past."""
        what.when_s = when_s
        timers = self._timers
        place = len(timers)
        while place and timers[place - 1].when_s > when_s:  # few are later: a heap would cost more
            place -= 1
            if timers[place].is_cancelled:  # no later one need pass it again
                timers.pop(place)
        timers.insert(place, what)

    def wake_at(self, when_s: float) -> WakeUp:
        """Return what a task awaits at once, to be woken at a time."""
        wake_up = WakeUp(self)
        self.at(when_s, wake_up)
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
            finally:  # also where ``fails`` raises
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
