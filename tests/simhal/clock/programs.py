"""Programs that note what they do; what they note, and when, must not depend on the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import suppress
from contextvars import ContextVar

from wayfarer.control.rate import Rate
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
    cancelled_before_it_starts,
    threads,
    context_follows_the_code,
    errors_without_an_owner_reach_the_handler,
    generators_are_closed,
)
