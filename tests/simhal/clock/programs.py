"""Programs that note what they do; what they note, and when, must not depend on the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from contextvars import ContextVar

from wayfarer.control.rate import AtOnce, Clock, Rate
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

LoopFactory = Callable[[], asyncio.AbstractEventLoop]
Note = Callable[[str], None]
Program = Callable[[Note], Awaitable[None]]


def trace_of(program: Program, loop_factory: LoopFactory = VirtualLoop) -> list[tuple[float, str]]:
    """Run a program and return what it noted, each with its time."""
    trace: list[tuple[float, str]] = []

    async def main() -> None:
        time = asyncio.get_running_loop().time
        await program(lambda text: trace.append((round(time(), 6), text)))
        trace.append((round(time(), 6), "end"))

    with asyncio.Runner(loop_factory=loop_factory) as runner:
        runner.run(main())
    return trace


async def sleeper(note: Note, name: str, *delays_s: float) -> None:
    try:
        for delay_s in delays_s:
            await asyncio.sleep(delay_s)
            note(name)
    except asyncio.CancelledError:
        note(f"{name} cancelled")
        raise


async def timers_in_time_order(note: Note) -> None:
    async with asyncio.TaskGroup() as group:
        for name, delay_s in (("c", 3.0), ("a", 1.0), ("b", 2.0)):
            group.create_task(sleeper(note, name, delay_s, 3.5))


async def yielding_takes_turns(note: Note) -> None:
    await asyncio.gather(sleeper(note, "a", 0, 0, -1, 0), sleeper(note, "b", 0, -0.5, 0, 2))


async def call_soon_comes_before_timers(note: Note) -> None:
    loop = asyncio.get_running_loop()
    loop.call_later(0.5, note, "timer")
    loop.call_soon(note, "soon")
    loop.call_soon_threadsafe(note, "soon too")
    note("running")
    await asyncio.sleep(1.0)


async def call_at_in_the_past_runs_now(note: Note) -> None:
    await asyncio.sleep(2.0)
    asyncio.get_running_loop().call_at(1.0, note, "late")
    await asyncio.sleep(1.0)


async def cancelled_timer_never_runs(note: Note) -> None:
    loop = asyncio.get_running_loop()
    timer, soon = loop.call_later(1.0, note, "timer"), loop.call_soon(note, "soon")
    timer.cancel()
    soon.cancel()
    note(f"{timer.cancelled()} {soon.cancelled()}")
    await asyncio.sleep(2.0)


async def timeouts(note: Note) -> None:
    loop = asyncio.get_running_loop()
    with suppress(TimeoutError):
        async with asyncio.timeout(1.0):
            await sleeper(note, "a", 0.75, 0.75)
    with suppress(TimeoutError):
        async with asyncio.timeout_at(loop.time() - 5.0):
            await sleeper(note, "b", 1.0)
    async with asyncio.timeout(5.0) as outer:
        with suppress(TimeoutError):
            async with asyncio.timeout(0.5):
                await sleeper(note, "c", 1.0)
        outer.reschedule(loop.time() + 9.0)
        await sleeper(note, "d", 8.0)
    note(f"outer expired: {outer.expired()}")


async def cancelled_while_sleeping(note: Note) -> None:
    task = asyncio.ensure_future(sleeper(note, "a", 1.0, 1.0))
    await asyncio.sleep(1.5)
    note(f"{task.cancel()}")
    with suppress(asyncio.CancelledError):
        await task
    note(f"{task.cancelled()}")


async def paced_tasks_of_which_one_is_cancelled(note: Note) -> None:
    """``Rate`` has a way of its own to wake its task on the virtual loop."""

    async def paced(name: str, rate_hz: float) -> None:
        rate = Rate(rate_hz)
        while True:
            await rate.wait()
            note(name)

    tasks = [asyncio.ensure_future(paced(name, rate_hz)) for name, rate_hz in (("a", 7.0), ("b", 3.0))]
    await asyncio.sleep(1.1)
    tasks[0].cancel()
    await asyncio.sleep(1.1)
    tasks[1].cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    await asyncio.sleep(1.1)


class Work(AtOnce):
    """What a paced task does: it waits every ``waits`` times, and ``act`` is given how often it was done."""

    def __init__(self, act: Callable[[int], object], waits: int = 3) -> None:
        self._act, self._waits, self.times = act, waits, 0

    def at_once(self, clock: Clock) -> bool:
        waits = (self.times + 1) % self._waits == 0
        if not waits:
            self._do()
        return not waits

    def _do(self) -> None:
        self.times += 1
        self._act(self.times)

    async def keep_doing(self, rate_hz: float) -> None:
        """What the task is."""
        rate = Rate(rate_hz)
        while True:
            await rate.wait(self)
            if (self.times + 1) % self._waits == 0:
                await asyncio.sleep(1 / 64)
            self._do()


async def paced_tasks_whose_work_rarely_waits(note: Note) -> None:
    """Most of it is done at once on the virtual loop, without a step of the task."""
    works = [Work(lambda times, name=name: note(f"{name} {times}")) for name in "ab"]  # type: ignore[misc]
    tasks = [asyncio.ensure_future(work.keep_doing(rate_hz)) for work, rate_hz in zip(works, (7.0, 3.0), strict=True)]
    async with asyncio.timeout(9.0):
        await asyncio.sleep(1.1)
        tasks[0].cancel("enough")
        await asyncio.sleep(1.1)
        tasks[1].cancel("enough")
        note(repr(await asyncio.gather(*tasks, return_exceptions=True)))
    await asyncio.sleep(1.1)


async def error_of_paced_work_is_raised_in_its_task(note: Note) -> None:
    def fail(times: int) -> None:
        if times % 2 == 0:
            raise ValueError(f"the {times}th time")

    work = Work(fail, waits=10**9)
    for _ in range(3):
        try:
            await work.keep_doing(8.0)
        except ValueError as error:
            note(str(error))
    try:
        async with asyncio.TaskGroup() as group:
            group.create_task(sleeper(note, "beside it", 9.0))
            group.create_task(work.keep_doing(8.0))
    except* ValueError as errors:
        note(repr(errors))


async def paced_work_that_cancels(note: Note) -> None:
    """Its own task, then another's; and a task that takes that back goes on."""

    def cancel(times: int) -> None:
        note(f"{times}")
        if times in {2, 5}:
            note(f"cancelled {whose.cancel('enough')}")

    work = Work(cancel)
    whose = doing = asyncio.ensure_future(work.keep_doing(8.0))
    note(repr(await asyncio.gather(doing, return_exceptions=True)))
    whose = asyncio.ensure_future(sleeper(note, "other", 9.0))
    doing = asyncio.ensure_future(work.keep_doing(8.0))
    note(repr(await asyncio.gather(whose, return_exceptions=True)))
    doing.cancel()
    with suppress(asyncio.CancelledError):
        await doing

    async def undaunted() -> None:
        while True:
            try:
                await work.keep_doing(8.0)
            except asyncio.CancelledError as error:
                note(f"taken back {error.args} {asyncio.current_task().uncancel()}")  # type: ignore[union-attr]
                if work.times > 7:
                    raise

    work = Work(cancel)
    whose = asyncio.ensure_future(undaunted())
    await asyncio.sleep(1.05)
    whose.cancel()
    note(repr(await asyncio.gather(whose, return_exceptions=True)))


async def cancelled_before_it_starts(note: Note) -> None:
    task = asyncio.ensure_future(sleeper(note, "a", 1.0))
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    note(f"{task.cancelled()}")


async def threads(note: Note) -> None:
    def fail() -> None:
        raise ValueError("on purpose")

    note(str(await asyncio.to_thread(lambda: "from a thread")))
    try:
        await asyncio.to_thread(fail)
    except ValueError as error:
        note(str(error))


async def context_follows_the_code(note: Note) -> None:
    name: ContextVar[str] = ContextVar("name", default="unset")
    loop = asyncio.get_running_loop()

    async def child() -> None:
        await asyncio.sleep(0.5)
        note(f"child sees {name.get()}")
        name.set("child")

    name.set("parent")
    loop.call_soon(lambda: note(f"callback sees {name.get()}"))
    loop.call_later(0.25, lambda: note(f"timer sees {name.get()}"))
    task = asyncio.ensure_future(child())
    name.set("changed")
    await task
    note(f"parent sees {name.get()}")
    note(f"thread sees {await asyncio.to_thread(name.get)}")


async def errors_without_an_owner_reach_the_handler(note: Note) -> None:
    def fail() -> None:
        raise ValueError("on purpose")

    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda _loop, context: note(f"handler got {context['exception']}"))
    loop.call_soon(fail)
    loop.call_later(1.0, fail)
    await sleeper(note, "goes on", 0.5, 1.0)


async def generators_are_closed(note: Note) -> None:
    async def count() -> AsyncIterator[int]:
        try:
            for number in range(5):
                yield number
                await asyncio.sleep(0.5)
        finally:
            note("closing")
            await asyncio.sleep(0.5)
            note("closed")

    async for number in count():
        note(str(number))
        if number == 2:
            break
    await asyncio.sleep(2.0)


PROGRAMS: tuple[Program, ...] = (
    timers_in_time_order,
    yielding_takes_turns,
    call_soon_comes_before_timers,
    call_at_in_the_past_runs_now,
    cancelled_timer_never_runs,
    timeouts,
    cancelled_while_sleeping,
    paced_tasks_of_which_one_is_cancelled,
    paced_tasks_whose_work_rarely_waits,
    error_of_paced_work_is_raised_in_its_task,
    paced_work_that_cancels,
    cancelled_before_it_starts,
    threads,
    context_follows_the_code,
    errors_without_an_owner_reach_the_handler,
    generators_are_closed,
)
