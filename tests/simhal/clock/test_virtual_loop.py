"""The virtual loop keeps asyncio's promises: the same programs run on it and on the stock loop, step for step."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import suppress
from contextvars import ContextVar
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.stock_loop import JumpingStockLoop
from wayfarer.control.rate import Rate
from wayfarer.errors import NothingScheduled
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

LoopFactory = Callable[[], asyncio.AbstractEventLoop]
Note = Callable[[str], None]
Program = Callable[[Note], Awaitable[None]]

virtual_loop: LoopFactory = VirtualLoop

CENTURY_S = 100 * 365.25 * 86400.0


def trace_of(program: Program, loop_factory: LoopFactory = virtual_loop) -> list[tuple[float, str]]:
    """Run a program and return what it noted, each with its time."""
    trace: list[tuple[float, str]] = []

    async def main() -> None:
        time = asyncio.get_running_loop().time
        await program(lambda text: trace.append((round(time(), 6), text)))
        trace.append((round(time(), 6), "end"))

    with asyncio.Runner(loop_factory=loop_factory) as runner:
        runner.run(main())
    return trace


def run(main: Callable[[], Any]) -> Any:
    with asyncio.Runner(loop_factory=virtual_loop) as runner:
        return runner.run(main())


@pytest.fixture
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    loop = virtual_loop()
    yield loop
    loop.close()


async def sleeper(note: Note, name: str, *delays_s: float) -> None:
    try:
        for delay_s in delays_s:
            await asyncio.sleep(delay_s)
            note(name)
    except asyncio.CancelledError:
        note(f"{name} cancelled")
        raise


# -- programs: what they note must not depend on the loop ------------------------------------------------------------


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


async def failing_task_cancels_its_group(note: Note) -> None:
    async def fail() -> None:
        await asyncio.sleep(1.5)
        raise ValueError("on purpose")

    try:
        async with asyncio.TaskGroup() as group:
            group.create_task(sleeper(note, "a", 1.0, 1.0))
            group.create_task(fail())
    except* ValueError as errors:
        note(str(errors.exceptions[0]))


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


async def waiting_for(note: Note) -> None:
    note(str(await asyncio.wait_for(asyncio.sleep(1.0, "result"), 2.0)))
    with suppress(TimeoutError):
        await asyncio.wait_for(sleeper(note, "a", 0.75, 0.75), 1.0)
    tasks = [asyncio.ensure_future(sleeper(note, name, delay_s)) for name, delay_s in (("b", 1.0), ("c", 2.0))]
    done, pending = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    note(f"{len(done)} done, {len(pending)} pending")
    for task in asyncio.as_completed(pending):
        await task


async def gathering(note: Note) -> None:
    async def fail() -> None:
        await asyncio.sleep(0.5)
        raise ValueError("on purpose")

    results = await asyncio.gather(asyncio.sleep(1.0, "first"), fail(), return_exceptions=True)
    note(repr(results))
    with suppress(ValueError):
        await asyncio.gather(sleeper(note, "survivor", 0.25, 0.5), fail())
    await asyncio.sleep(2.0)


async def events_and_queues(note: Note) -> None:
    event, queue = asyncio.Event(), asyncio.Queue[int](maxsize=2)

    async def produce() -> None:
        await event.wait()
        for item in range(5):
            await queue.put(item)
            note(f"put {item}")

    async def consume() -> None:
        for _ in range(5):
            note(f"got {await queue.get()}")
            await asyncio.sleep(0.5)

    async with asyncio.TaskGroup() as group:
        group.create_task(produce())
        group.create_task(consume())
        asyncio.get_running_loop().call_later(1.25, event.set)


async def locks_are_fair(note: Note) -> None:
    lock = asyncio.Lock()

    async def hold(name: str, delay_s: float) -> None:
        await asyncio.sleep(delay_s)
        async with lock:
            note(f"{name} has it")
            await asyncio.sleep(1.0)

    await asyncio.gather(hold("a", 0.2), hold("b", 0.4), hold("c", 0.3))


async def shield_outlives_cancellation(note: Note) -> None:
    inner = asyncio.ensure_future(sleeper(note, "inner", 1.0, 1.0))

    async def outer() -> None:
        try:
            await asyncio.shield(inner)
        except asyncio.CancelledError:
            note("outer cancelled")
            raise

    task = asyncio.ensure_future(outer())
    await asyncio.sleep(0.5)
    task.cancel()
    await inner


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
    failing_task_cancels_its_group,
    timeouts,
    waiting_for,
    gathering,
    events_and_queues,
    locks_are_fair,
    shield_outlives_cancellation,
    cancelled_while_sleeping,
    paced_tasks_of_which_one_is_cancelled,
    cancelled_before_it_starts,
    threads,
    context_follows_the_code,
    errors_without_an_owner_reach_the_handler,
    generators_are_closed,
)


@pytest.mark.parametrize("program", PROGRAMS)
def test_program_runs_as_on_the_stock_loop(program: Program) -> None:
    trace = trace_of(program)
    assert trace == trace_of(program, JumpingStockLoop)
    assert len(trace) > 1


@pytest.mark.parametrize("program", PROGRAMS)
def test_ten_runs_give_one_trace(program: Program) -> None:
    assert len({tuple(trace_of(program)) for _ in range(10)}) == 1


steps = st.one_of(st.integers(0, 5), st.just("yield"), st.just("cancel"))


@given(scripts=st.lists(st.lists(steps, max_size=6), min_size=1, max_size=5))
def test_any_program_runs_as_on_the_stock_loop(scripts: list[list[int | str]]) -> None:
    """Each task has its own fraction of a second, since the stock loop promises no order for equal times."""

    async def program(note: Note) -> None:
        async def play(number: int, script: list[int | str]) -> None:
            await asyncio.sleep((number + 1) / 64)
            for step in script:
                note(f"{number} {step}")
                if step == "cancel":
                    tasks[(number + 1) % len(tasks)].cancel()
                await asyncio.sleep(step if isinstance(step, int) else 0)

        tasks = [asyncio.ensure_future(play(*item)) for item in enumerate(scripts)]
        results = await asyncio.gather(*tasks, return_exceptions=True)
        note(repr([type(result).__name__ for result in results]))

    assert trace_of(program) == trace_of(program, JumpingStockLoop)


# -- what virtual time adds ------------------------------------------------------------------------------------------


def test_two_tasks_sleep_centuries_in_order_at_once() -> None:
    async def program(note: Note) -> None:
        await asyncio.gather(sleeper(note, "long", 9 * CENTURY_S), sleeper(note, "short", CENTURY_S))

    assert trace_of(program) == [
        (CENTURY_S, "short"),
        (9 * CENTURY_S, "long"),
        (9 * CENTURY_S, "end"),
    ]


def test_equal_times_run_in_order_of_creation(loop: asyncio.AbstractEventLoop) -> None:
    ran: list[int] = []
    for number in range(50):
        loop.call_later(1.0, ran.append, number)
    loop.call_later(1.0, loop.stop)
    loop.run_forever()
    assert ran == list(range(50))


moments_s = st.floats(0, 1e6)


@given(when_s=moments_s, asked_at_s=st.lists(moments_s, max_size=5))
def test_call_at_is_punctual_and_in_order_whenever_it_was_asked_for(when_s: float, asked_at_s: list[float]) -> None:
    ran: list[tuple[float, float]] = []
    with asyncio.Runner(loop_factory=virtual_loop) as runner:
        loop = runner.get_loop()

        def note(asked_s: float) -> None:
            ran.append((loop.time(), asked_s))

        async def ask() -> None:
            for now_s in sorted(asked_at_s):
                await asyncio.sleep(now_s * when_s / 1e6 - loop.time())
                loop.call_at(when_s, note, loop.time())
            await asyncio.sleep(when_s + 1.0)

        runner.run(ask())
    assert ran == sorted(ran)
    assert all(time_s == max(when_s, asked_s) for time_s, asked_s in ran)


@given(delays_s=st.lists(st.floats(-10, 1e9), min_size=1, max_size=20))
def test_time_never_runs_backwards_and_no_timer_is_early(delays_s: list[float]) -> None:
    loop = virtual_loop()
    ran_at_s: list[float] = []
    for delay_s in delays_s:
        loop.call_later(delay_s, lambda: ran_at_s.append(loop.time()))
    loop.call_later(max(delays_s), loop.stop)
    loop.run_forever()
    loop.close()
    assert ran_at_s == [max(delay_s, 0.0) for delay_s in sorted(delays_s)]


def test_cancelled_timers_do_not_move_the_clock(loop: asyncio.AbstractEventLoop) -> None:
    loop.call_later(5.0, loop.stop).cancel()
    loop.call_later(1.0, loop.stop)
    loop.run_forever()
    assert loop.time() == 1.0


def test_an_hour_of_control_periods_takes_an_hour() -> None:
    async def main() -> float:
        for _ in range(20 * 3600):
            await asyncio.sleep(0.05)
        return asyncio.get_running_loop().time()

    assert run(main) == pytest.approx(3600.0, abs=1e-6)


def test_time_stands_still_while_code_runs() -> None:
    async def main() -> tuple[float, float]:
        loop = asyncio.get_running_loop()
        before_s = loop.time()
        for _ in range(100):
            await asyncio.sleep(0)
            await asyncio.to_thread(sum, range(1000))
        return before_s, loop.time()

    assert run(main) == (0.0, 0.0)


def test_waiting_for_nothing_is_an_error_that_names_who_waits() -> None:
    async def wait_for_ever() -> None:
        await asyncio.Event().wait()

    async def main() -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(wait_for_ever(), name="sensor:compass")
            await asyncio.sleep(2.5)

    with pytest.raises(NothingScheduled, match=r"stands at 2\.500 s.*sensor:compass"):
        run(main)


def test_running_an_idle_loop_is_an_error(loop: asyncio.AbstractEventLoop) -> None:
    with pytest.raises(NothingScheduled, match="no task left"):
        loop.run_forever()


# -- running and closing ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
def test_interruption_comes_out_of_a_callback_and_the_loop_can_go_on(
    loop: asyncio.AbstractEventLoop, error: type[BaseException]
) -> None:
    def interrupt() -> None:
        raise error

    loop.call_later(1.0, interrupt)
    loop.call_later(2.0, loop.stop)
    with pytest.raises(error):
        loop.run_forever()
    assert (loop.time(), loop.is_running()) == (1.0, False)
    loop.run_forever()
    assert loop.time() == 2.0


def test_interruption_comes_out_of_a_task() -> None:
    async def interrupt() -> None:
        await asyncio.sleep(1.0)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(interrupt)


def test_exception_of_the_main_task_comes_out() -> None:
    async def fail() -> None:
        await asyncio.sleep(1.0)
        raise ValueError("on purpose")

    with pytest.raises(ValueError, match="on purpose"):
        run(fail)


def test_unhandled_error_is_logged_as_on_the_stock_loop(
    loop: asyncio.AbstractEventLoop, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        raise ValueError("on purpose")

    loop.call_soon(fail)
    loop.call_later(1.0, loop.stop)
    loop.run_forever()
    assert "exception in callback" in caplog.text
    assert "on purpose" in caplog.text


def test_runner_cancels_what_is_left_and_lets_it_finish() -> None:
    notes: list[str] = []

    async def stubborn() -> None:
        try:
            await asyncio.sleep(CENTURY_S)
        finally:
            await asyncio.sleep(1.0)
            notes.append("stopped")

    async def main() -> asyncio.Task[None]:
        task = asyncio.create_task(stubborn())
        await asyncio.sleep(0)
        return task

    task = run(main)
    assert notes == ["stopped"]
    assert task.cancelled()
    assert task.get_loop().is_closed()


def test_loop_refuses_to_run_twice_at_once_or_after_closing(loop: asyncio.AbstractEventLoop) -> None:
    async def nest() -> None:
        with pytest.raises(RuntimeError, match="already running"):
            loop.run_forever()
        with pytest.raises(RuntimeError, match="cannot close"):
            loop.close()

    loop.run_until_complete(nest())
    loop.close()
    with pytest.raises(RuntimeError, match="closed"):
        loop.run_forever()


def test_stopping_before_the_result_is_an_error(loop: asyncio.AbstractEventLoop) -> None:
    loop.call_later(1.0, loop.stop)
    future = loop.create_future()
    with pytest.raises(RuntimeError, match="stopped before"):
        loop.run_until_complete(future)
