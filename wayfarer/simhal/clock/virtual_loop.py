"""An asyncio event loop whose clock is virtual.

When nothing is ready to run, the clock jumps to the next timer instead of waiting for it: simulated hours pass as fast
as the code in them runs, in an order that depends only on the code. Field code cannot see the difference::

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(main())

Under asyncio's own (C) ``Task`` and ``Future`` there is a ``Schedule`` and nothing else: no selector, no sockets, no
subprocesses.

Time moves only when nothing is ready: a task that polls with ``sleep(0)`` for something that a timer brings waits for
ever, as it would burn a core on the stock loop.

Order: callbacks run in the order in which they became ready; timers in the order of their time, and of their creation
if the times are equal.
"""

from __future__ import annotations

import asyncio
import sys
from asyncio import AbstractEventLoop, events
from asyncio.log import logger
from collections.abc import AsyncGenerator, Awaitable, Callable, Coroutine, Generator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextvars import Context, copy_context
from dataclasses import dataclass
from functools import partial
from math import inf, isnan
from queue import Empty, SimpleQueue
from time import monotonic  # noqa: TID251 - the clock that the pace is measured with
from typing import Any, TypeVar, TypeVarTuple, Unpack, cast
from weakref import WeakSet

from wayfarer.errors import NothingScheduled
from wayfarer.simhal.clock.schedule import Fails, Handle, Schedule, Scheduled

T = TypeVar("T")
Ts = TypeVarTuple("Ts")


class VirtualLoop(asyncio.AbstractEventLoop):
    """Virtual time in seconds, starting at 0. Single-threaded; ``asyncio.to_thread`` runs its function inline."""

    def __init__(self, make_schedule: Callable[[asyncio.AbstractEventLoop, Fails], Schedule] = Schedule) -> None:
        self.clock = schedule = make_schedule(self, self._report_error)
        # Asked several times per tick: without a frame of ours in between.
        self.time = schedule.time  # type: ignore[method-assign]
        self.stall = schedule.stall
        self.stop = schedule.stop  # type: ignore[method-assign]
        self.create_future = partial(asyncio.Future, loop=self)  # type: ignore[method-assign]
        self._running = False
        self._closed = False
        self._debug = False
        self._asyncgens: WeakSet[AsyncGenerator[Any, Any]] = WeakSet()
        self._exception_handler: Callable[[asyncio.AbstractEventLoop, dict[str, Any]], object] | None = None

    # -- scheduling ----------------------------------------------------------------------------------------------

    def call_soon(  # type: ignore[override]
        self, callback: Callable[[Unpack[Ts]], object], *args: Unpack[Ts], context: Context | None = None
    ) -> Handle:
        """Run the callback when its turn comes, at the present time."""
        handle = Handle(callback, args, copy_context() if context is None else context)
        self.clock.soon(handle)
        return handle

    def call_soon_threadsafe(  # type: ignore[override]
        self, callback: Callable[[Unpack[Ts]], object], *args: Unpack[Ts], context: Context | None = None
    ) -> Handle:
        """Run the callback soon; also what a signal handler uses to wake the loop."""
        return self.call_soon(callback, *args, context=context)

    def call_later(  # type: ignore[override]
        self,
        delay: float,
        callback: Callable[[Unpack[Ts]], object],
        *args: Unpack[Ts],
        context: Context | None = None,
    ) -> Handle:
        """Run the callback ``delay`` seconds from now."""
        return self.call_at(self.time() + delay, callback, *args, context=context)

    def call_at(  # type: ignore[override]
        self,
        when: float,
        callback: Callable[[Unpack[Ts]], object],
        *args: Unpack[Ts],
        context: Context | None = None,
    ) -> Handle:
        """Run the callback at a time; at once, but never earlier than now, if that is past."""
        if isnan(when):
            raise ValueError("a timer needs a time, and this one is not a number")
        handle = Handle(callback, args, copy_context() if context is None else context)
        self.clock.at(when, handle)
        return handle

    # -- running -------------------------------------------------------------------------------------------------

    def run_forever(self) -> None:
        """Run until ``stop`` is called: after the callback that runs then.

        Raises:
            NothingScheduled: nothing is ready and no timer is set, so nothing can ever happen again.
        """
        if self._running or self._closed:
            raise RuntimeError("this event loop is closed" if self._closed else "this event loop is already running")
        self._running = True
        hooks = sys.get_asyncgen_hooks()
        sys.set_asyncgen_hooks(firstiter=self._asyncgens.add, finalizer=self._close_asyncgen)
        events._set_running_loop(self)
        try:
            if not copy_context().run(self.clock.run):  # what is done at once leaves nothing in the caller's context
                waiting = ", ".join(sorted(task.get_name() for task in asyncio.all_tasks(self)))
                raise NothingScheduled(
                    f"virtual time is stuck at {self.time():.3f} s: every task waits for something that nothing can "
                    f"bring ({f'waiting: {waiting}' if waiting else 'no task left'})"
                )
        finally:
            events._set_running_loop(None)
            sys.set_asyncgen_hooks(*hooks)
            self._running = False

    def run_until_complete(self, future: Generator[Any, None, T] | Awaitable[T]) -> T:
        """Run until the future is done and return its result."""
        made_here = not asyncio.isfuture(future)
        task: asyncio.Future[T] = asyncio.ensure_future(cast(Awaitable[T], future), loop=self)
        task.add_done_callback(self._stop_when_done)
        try:
            self.run_forever()
        except BaseException:
            if made_here and task.done() and not task.cancelled():
                task.exception()  # it is this error that is on its way; do not report it a second time
            raise
        finally:
            task.remove_done_callback(self._stop_when_done)
        if not task.done():
            raise RuntimeError("the event loop was stopped before the future was done")
        return task.result()

    def _stop_when_done(self, future: asyncio.Future[Any]) -> None:
        """Stop, unless the future ended by an error that has left the loop already."""
        if future.cancelled() or not isinstance(future.exception(), SystemExit | KeyboardInterrupt):
            self.stop()

    def is_running(self) -> bool:
        """Return whether the loop runs."""
        return self._running

    def is_closed(self) -> bool:
        """Return whether the loop was closed."""
        return self._closed

    def close(self) -> None:
        """Drop everything that is scheduled."""
        if self._running:
            raise RuntimeError("cannot close a running event loop")
        self._closed = True
        self.clock.clear()

    # -- tasks, futures, threads ---------------------------------------------------------------------------------

    def create_task(self, coro: Any, *, name: str | None = None, context: Context | None = None, **kwargs: Any) -> Any:
        """Return a task of this loop."""
        if self._closed:
            raise RuntimeError("this event loop is closed")
        return asyncio.Task(coro, loop=self, name=name, context=context, **kwargs)

    def run_in_executor(
        self, _executor: Executor | None, func: Callable[[Unpack[Ts]], T], *args: Unpack[Ts]
    ) -> asyncio.Future[T]:
        """Run the function inline: a thread would bring real time, and with it chance, into virtual time."""
        future: asyncio.Future[T] = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:
            future.set_exception(error)
        return future

    def _close_asyncgen(self, generator: AsyncGenerator[Any, Any]) -> None:
        """Close a generator that nobody uses any more; called when it is collected."""
        self._asyncgens.discard(generator)
        if not self._closed:
            self.create_task(generator.aclose())

    async def shutdown_asyncgens(self) -> None:
        """Close every generator that is still open."""
        generators = list(self._asyncgens)
        self._asyncgens.clear()
        await asyncio.gather(*(generator.aclose() for generator in generators), return_exceptions=True)

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:  # noqa: ASYNC109
        """Nothing to do: there is no executor."""

    # -- errors and debugging ------------------------------------------------------------------------------------

    def get_debug(self) -> bool:
        """Return whether asyncio's debug mode is on."""
        return self._debug

    def set_debug(self, enabled: bool) -> None:
        """Turn asyncio's debug mode on or off."""
        self._debug = enabled

    def set_exception_handler(
        self, handler: Callable[[asyncio.AbstractEventLoop, dict[str, Any]], object] | None
    ) -> None:
        """Set what is called for errors that no task awaits."""
        self._exception_handler = handler

    def get_exception_handler(self) -> Callable[[asyncio.AbstractEventLoop, dict[str, Any]], object] | None:
        """Return what is called for errors that no task awaits."""
        return self._exception_handler

    def default_exception_handler(self, context: dict[str, Any]) -> None:
        """Report through asyncio's logger, as the stock loop does."""
        error = context.get("exception")
        logger.error(context["message"], exc_info=error if error is not None else False)

    def call_exception_handler(self, context: dict[str, Any]) -> None:
        """Report an error that no task awaits."""
        if self._exception_handler is not None:
            self._exception_handler(self, context)
        else:
            self.default_exception_handler(context)

    def _report_error(self, what: Scheduled, error: BaseException) -> None:
        self.call_exception_handler({"message": f"exception in callback {what!r}", "exception": error})


# -- running a coroutine ---------------------------------------------------------------------------------------------
# Runs a coroutine in virtual time, from wherever it is called.


def run_virtually(
    main: Callable[[], Coroutine[Any, Any, T]], loop_factory: Callable[[], VirtualLoop] = VirtualLoop
) -> T:
    """Run ``main`` on a loop of virtual time to its end, and return its result.

    A notebook runs its cells on an event loop, and a thread has one running loop at most: there it is another
    thread that runs ``main``, while this one waits.
    """
    if asyncio._get_running_loop() is None:
        return _run(main, loop_factory)
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(_run, main, loop_factory).result()


def _run(main: Callable[[], Coroutine[Any, Any, T]], loop_factory: Callable[[], VirtualLoop]) -> T:
    with asyncio.Runner(loop_factory=loop_factory) as runner:
        return runner.run(main())


# -- at a pace ---------------------------------------------------------------------------------------------------------
# For people who look on: time goes no faster than they want, and may stand still. What runs on it runs exactly as on
# ``VirtualLoop``, because the pace only decides how long its thread waits between two virtual times. Other threads may
# call into it with ``call_soon_threadsafe``, also while it waits.

CATCH_UP_S = 0.05  # of the clock: a delay that is made up for afterwards; a longer one was not a hiccup


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
