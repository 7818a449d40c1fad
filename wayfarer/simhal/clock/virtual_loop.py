"""An asyncio event loop whose clock is virtual.

When nothing is ready to run, the clock jumps to the next timer instead of waiting for it: simulated hours pass as fast
as the code in them runs, in an order that depends on nothing but the code. Field code cannot tell the difference::

    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(main())

The loop keeps a deque of ready callbacks and a heap of timers under asyncio's own (C) ``Task`` and ``Future``, and
nothing else: no selector, no sockets, no subprocesses. A wake-up from ``asyncio.sleep`` costs a third of what it does
on the stock loop, and a control tick has three of them.

Time moves only when nothing is ready: a task that polls with ``sleep(0)`` for something that a timer brings waits for
ever, as it would burn a core on the stock loop.

Order: callbacks run in the order in which they became ready; timers in the order of their time, and of their creation
where the times are equal.
"""

from __future__ import annotations

import asyncio
import sys
from asyncio import events
from asyncio.log import logger
from collections import deque
from collections.abc import AsyncGenerator, Awaitable, Callable, Generator
from concurrent.futures import Executor
from contextvars import Context, copy_context
from functools import partial
from heapq import heappop, heappush
from itertools import count
from math import inf, isnan
from typing import Any, TypeVar, TypeVarTuple, Unpack, cast
from weakref import WeakSet

from wayfarer.errors import NothingScheduled

T = TypeVar("T")
Ts = TypeVarTuple("Ts")


class _Handle(list[Any]):
    """A callback to run, or not, if it is cancelled before its turn. Stands in for ``asyncio.TimerHandle``.

    It is its own heap entry ``[when_s, number, call, context]``: a list because lists are made and compared in C, and
    the number because no two may compare equal. ``call`` is the callback and its arguments.
    """

    __slots__ = ()

    def cancel(self) -> None:
        self[_CALL] = None

    def cancelled(self) -> bool:
        return self[_CALL] is None


_WHEN, _CALL = 0, 2


class VirtualLoop(asyncio.AbstractEventLoop):
    """Virtual time in seconds, starting at 0. Single-threaded; ``asyncio.to_thread`` runs its function inline."""

    def __init__(self) -> None:
        self._now_s = 0.0
        # Handles, and what ``wake_at`` makes: a future in place of the call.
        self._ready: deque[list[Any]] = deque()
        self._timers: list[list[Any]] = []
        self._number = count(1).__next__
        self._running = False
        self._closed = False
        self._stopping = False
        self._debug = False
        self.create_future = partial(asyncio.Future, loop=self)  # type: ignore[method-assign]
        self._asyncgens: WeakSet[AsyncGenerator[Any, Any]] = WeakSet()
        self._exception_handler: Callable[[asyncio.AbstractEventLoop, dict[str, Any]], object] | None = None

    # -- time and scheduling -------------------------------------------------------------------------------------

    def time(self) -> float:
        """Return the virtual time in seconds."""
        return self._now_s

    def stall(self, for_s: float) -> None:
        """Let time pass in which nothing runs, as when a callback blocks or the computer was suspended."""
        self._now_s += for_s

    def call_soon(self, *call: Any, context: Context | None = None) -> _Handle:  # type: ignore[override]
        """Run a callback, with the arguments that follow it, when its turn comes, at the present time."""
        handle = _Handle((0.0, 0, call, copy_context() if context is None else context))
        self._ready.append(handle)
        return handle

    def call_soon_threadsafe(  # type: ignore[override]
        self, callback: Callable[[Unpack[Ts]], object], *args: Unpack[Ts], context: Context | None = None
    ) -> _Handle:
        """Run the callback soon; also what a signal handler uses to wake the loop."""
        return self.call_soon(callback, *args, context=context)

    def call_later(  # type: ignore[override]
        self,
        delay: float,
        callback: Callable[[Unpack[Ts]], object],
        *args: Unpack[Ts],
        context: Context | None = None,
    ) -> _Handle:
        """Run the callback ``delay`` seconds from now."""
        return self.call_at(self._now_s + delay, callback, *args, context=context)

    def call_at(  # type: ignore[override]
        self,
        when: float,
        callback: Callable[[Unpack[Ts]], object],
        *args: Unpack[Ts],
        context: Context | None = None,
    ) -> _Handle:
        """Run the callback at a time; at once, but never earlier than now, where that is past."""
        if isnan(when):
            raise ValueError("a timer needs a time, and this one is not a number")
        if context is None:
            context = copy_context()
        handle = _Handle((when, self._number(), (callback, *args), context))
        heappush(self._timers, handle)
        return handle

    def wake_at(self, when_s: float) -> asyncio.Future[None]:
        """Return a future that is done at a time: a timer without the cost of a callback, a context and a handle."""
        wake_up: asyncio.Future[None] = self.create_future()
        heappush(self._timers, [when_s, self._number(), wake_up])
        return wake_up

    # -- running -------------------------------------------------------------------------------------------------

    def run_forever(self) -> None:
        """Run until ``stop`` is called.

        Raises:
            NothingScheduled: nothing is ready and no timer is set, so nothing can ever happen again.
        """
        if self._running or self._closed:
            raise RuntimeError("this event loop is closed" if self._closed else "this event loop is already running")
        self._running = True
        self._stopping = False
        hooks = sys.get_asyncgen_hooks()
        sys.set_asyncgen_hooks(firstiter=self._asyncgens.add, finalizer=self._close_asyncgen)
        events._set_running_loop(self)
        try:
            self._run()
        finally:
            events._set_running_loop(None)
            sys.set_asyncgen_hooks(*hooks)
            self._running = False

    def _run(self) -> None:
        """Run what is ready, in turn; when nothing is, jump to the next timer."""
        ready, take, jump = self._ready, self._ready.popleft, self._jump
        while not self._stopping:
            if not ready:
                jump()
            handle = take()
            if type(handle) is not _Handle:  # of ``wake_at``
                wake_up = handle[_CALL]
                if not wake_up.done():  # cancelled with its task
                    wake_up.set_result(None)
                continue
            _, _, call, context = handle
            if call is None:
                continue
            try:
                context.run(*call)
            except (SystemExit, KeyboardInterrupt):
                raise
            except BaseException as error:
                self.call_exception_handler({"message": f"exception in callback {call[0]!r}", "exception": error})

    def _jump(self) -> None:
        """Move the clock to the next timer and make every timer of that moment ready, in order of creation."""
        ready, timers = self._ready, self._timers
        while timers and timers[0][_CALL] is None:
            heappop(timers)
        if not timers or timers[0][_WHEN] == inf:
            raise NothingScheduled(
                f"virtual time stands at {self._now_s:.3f} s: every task waits for something that nothing can bring "
                f"({self._describe_tasks()})"
            )
        now_s = timers[0][_WHEN]
        self._now_s = now_s if now_s > self._now_s else self._now_s
        while timers and timers[0][_WHEN] <= now_s:
            ready.append(heappop(timers))

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
            self._stopping = True

    def stop(self) -> None:
        """Stop after the callback that runs now."""
        self._stopping = True

    def is_running(self) -> bool:
        """Tell whether the loop runs."""
        return self._running

    def is_closed(self) -> bool:
        """Tell whether the loop was closed."""
        return self._closed

    def close(self) -> None:
        """Drop everything that is scheduled."""
        if self._running:
            raise RuntimeError("cannot close a running event loop")
        self._closed = True
        self._ready.clear()
        self._timers.clear()

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
        """Tell whether asyncio's debug mode is on."""
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

    def _describe_tasks(self) -> str:
        names = sorted(task.get_name() for task in asyncio.all_tasks(self))
        return "waiting: " + ", ".join(names) if names else "no task left"
