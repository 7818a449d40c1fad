"""The virtual loop keeps asyncio's promises: the same programs run on it and on the stock loop, step for step."""

from __future__ import annotations

import asyncio
import weakref
from collections.abc import Iterator
from contextlib import suppress
from contextvars import ContextVar
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.stock_loop import JumpingStockLoop
from tests.simhal.clock.programs import PROGRAMS, LoopFactory, Note, Program, Work, trace_of
from tests.virtual import virtual
from wayfarer.control.rate import Rate
from wayfarer.errors import NothingScheduled
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

virtual_loop: LoopFactory = VirtualLoop


@pytest.fixture
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    loop = virtual_loop()
    yield loop
    loop.close()


@pytest.mark.parametrize("program", PROGRAMS)
def test_program_runs_as_on_the_stock_loop(program: Program) -> None:
    trace = trace_of(program)
    assert trace == trace_of(program, JumpingStockLoop)
    assert len(trace) > 1


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


def test_equal_times_run_in_order_of_creation(loop: asyncio.AbstractEventLoop) -> None:
    ran: list[int] = []
    for number in range(50):
        loop.call_later(1.0, ran.append, number)
    loop.call_later(1.0, loop.stop)
    loop.run_forever()
    assert ran == list(range(50))


@virtual
async def test_paced_task_and_sleeping_one_take_turns_as_their_timers_were_made() -> None:
    order: list[str] = []

    async def pace() -> None:
        rate = Rate(8.0)
        for _ in range(4):
            await rate.wait()
            order.append("paced")

    async def sleep() -> None:
        for _ in range(2):
            await asyncio.sleep(0.25)
            order.append("slept")

    await asyncio.gather(pace(), sleep())
    assert order == ["paced", "slept", "paced", "paced", "slept", "paced"]


@pytest.mark.parametrize("when", ["while it waits", "at the moment when it is due"])
@virtual
async def test_paced_task_that_is_cancelled_ends_at_once_and_its_timer_wakes_nobody(when: str) -> None:
    loop, ended_s = asyncio.get_running_loop(), []

    async def pace() -> None:
        rate = Rate(1.0)
        try:
            await rate.wait()
        except asyncio.CancelledError as error:
            ended_s.append((loop.time(), error.args))
            await asyncio.sleep(3.0)
            raise

    if when == "while it waits":
        task = asyncio.create_task(pace())
        await asyncio.sleep(0.5)
        task.cancel("enough")
    else:
        loop.call_at(1.0, lambda: task.cancel("enough"))
        task = asyncio.create_task(pace())
    with pytest.raises(asyncio.CancelledError):
        await task
    assert ended_s == [(0.5 if when == "while it waits" else 1.0, ("enough",))]
    assert loop.time() == ended_s[0][0] + 3.0


@pytest.mark.parametrize("first", ["timer", "task"])
@virtual
async def test_work_that_is_due_as_its_task_is_cancelled_is_not_done(first: str) -> None:
    loop, done = asyncio.get_running_loop(), list[int]()

    async def begin() -> asyncio.Task[None]:
        task = asyncio.create_task(Work(done.append).keep_doing(1.0))
        await asyncio.sleep(0.5)
        return task

    if first == "task":
        task = await begin()
        loop.call_at(1.0, lambda: task.cancel())
    else:
        loop.call_at(1.0, lambda: task.cancel())
        task = await begin()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert (loop.time(), done) == (1.0, [])


def test_context_of_what_is_done_at_once_is_gone_after_the_run() -> None:
    """A trial must leave nothing to the next one."""
    name: ContextVar[int] = ContextVar("name", default=0)
    name.set(1)
    seen: list[int] = []

    def act(times: int) -> None:
        seen.append(name.get())
        name.set(times + 1)

    @virtual
    async def main() -> None:
        with suppress(TimeoutError):
            async with asyncio.timeout(0.9):
                await Work(act, waits=10**9).keep_doing(4.0)

    main()
    assert (seen, name.get()) == ([1, 2, 3], 1)


moments_s = st.floats(0, 1e6)


@given(when_s=moments_s, asked_at_s=st.lists(moments_s, max_size=5))
def test_call_at_is_punctual_and_in_order_whenever_it_was_asked_for(when_s: float, asked_at_s: list[float]) -> None:
    ran: list[tuple[float, float]] = []
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
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


timers = st.tuples(st.one_of(st.integers(-3, 8).map(float), st.just(inf)), st.integers(0, 3), st.booleans())


@given(planned=st.lists(timers, min_size=1, max_size=20))
def test_timers_run_in_the_order_of_the_stock_loop_also_those_of_the_past(
    planned: list[tuple[float, int, bool]],
) -> None:
    """Each timer may cancel another and begin a further one. No two have the same time: the stock loop orders none."""

    def played(factory: LoopFactory) -> list[tuple[float, int]]:
        loop, ran, begun = factory(), [], list[asyncio.TimerHandle]()

        def begin(number: int, from_s: float) -> None:
            begun.append(loop.call_at(from_s + planned[number][0] + len(begun) / 4096, run, number))

        def run(number: int) -> None:
            ran.append((loop.time(), number))
            _, cancels, begins = planned[number]
            if cancels:
                begun[number * cancels % len(begun)].cancel()
            if begins and len(begun) < 100:
                begin((number * 5 + 1) % len(planned), float(int(loop.time())))

        for number in range(len(planned)):
            begin(number, 0.0)
        loop.call_at(1e4, loop.stop)
        loop.run_forever()
        loop.close()
        return ran

    assert played(virtual_loop) == played(JumpingStockLoop)


def test_cancelled_timers_do_not_move_the_clock(loop: asyncio.AbstractEventLoop) -> None:
    loop.call_later(5.0, loop.stop).cancel()
    loop.call_later(1.0, loop.stop)
    loop.run_forever()
    assert loop.time() == 1.0


@virtual
async def test_time_stands_still_while_code_runs() -> None:
    loop = asyncio.get_running_loop()
    assert loop.time() == 0.0
    for _ in range(100):
        await asyncio.sleep(0)
        await asyncio.to_thread(sum, range(1000))
    assert loop.time() == 0.0


def test_waiting_for_nothing_is_an_error_that_names_who_waits() -> None:
    async def wait_for_ever() -> None:
        await asyncio.Event().wait()

    @virtual
    async def main() -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(wait_for_ever(), name="sensor:compass")
            await asyncio.sleep(2.5)

    with pytest.raises(NothingScheduled, match=r"stuck at 2\.500 s.*sensor:compass"):
        main()


def test_running_an_idle_loop_is_an_error(loop: asyncio.AbstractEventLoop) -> None:
    with pytest.raises(NothingScheduled, match="no task left"):
        loop.run_forever()


def test_timer_that_never_comes_is_nothing_to_wait_for(loop: asyncio.AbstractEventLoop) -> None:
    loop.call_at(inf, loop.stop)
    loop.call_at(1.0, int)
    with pytest.raises(NothingScheduled):
        loop.run_forever()
    assert loop.time() == 1.0


def test_time_limits_that_were_kept_do_not_pile_up(loop: asyncio.AbstractEventLoop) -> None:
    class Work:
        def late(self) -> None:
            raise AssertionError("its time limit was cancelled")

    def begin() -> weakref.ref[Work]:
        work = Work()
        loop.call_later(60.0, work.late).cancel()
        return weakref.ref(work)

    kept = [begin() for _ in range(10)]
    loop.call_later(1.0, loop.stop)
    assert [work() for work in kept] == [None] * 10
    loop.run_forever()
    assert loop.time() == 1.0


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


def test_error_of_an_exception_handler_comes_out_and_nothing_that_was_ready_is_lost(
    loop: asyncio.AbstractEventLoop,
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("on purpose")

    ran: list[str] = []
    loop.set_exception_handler(fail)
    loop.call_soon(fail)
    loop.call_soon(ran.append, "next")
    loop.call_soon(loop.stop)
    with pytest.raises(RuntimeError, match="on purpose"):
        loop.run_forever()
    loop.run_forever()
    assert ran == ["next"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_error_of_the_main_task_comes_out(error: type[BaseException]) -> None:
    @virtual
    async def fail() -> None:
        await asyncio.sleep(1.0)
        raise error("on purpose")

    with pytest.raises(error, match="on purpose"):
        fail()


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
            await asyncio.sleep(1e9)
        finally:
            await asyncio.sleep(1.0)
            notes.append("stopped")

    async def main() -> asyncio.Task[None]:
        task = asyncio.create_task(stubborn())
        await asyncio.sleep(0)
        return task

    runner = asyncio.Runner(loop_factory=VirtualLoop)
    task = runner.run(main())
    runner.close()
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
