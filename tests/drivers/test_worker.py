"""A bus that hangs holds its own thread and nothing else: deadlines, refusals, and stops that go first."""

from __future__ import annotations

import asyncio
import errno
import os
import threading
from collections.abc import AsyncIterator, Callable

import pytest

from wayfarer.drivers.buses import CLOSE_WAIT_S
from wayfarer.drivers.threaded import Worker
from wayfarer.errors import NotResponding

DEADLINE_S = 0.2  # a thread of a busy computer begins a job within it
LONG_S = 5.0  # a test that needs as long has failed


class Bus:
    """A worker, what its jobs did, and a job that hangs until it is freed."""

    def __init__(self) -> None:
        self.worker = Worker("bus", DEADLINE_S)
        self.done: list[str] = []
        self.freed = threading.Event()
        self.hangs = threading.Event()

    def job(self, name: str) -> Callable[[], str]:
        def do() -> str:
            self.done.append(name)
            return name

        return do

    def hang(self) -> None:
        self.hangs.set()
        assert self.freed.wait(LONG_S)
        self.done.append("hung")

    async def is_hanging(self) -> None:
        assert await asyncio.to_thread(self.hangs.wait, LONG_S)

    async def hanging_call(self, deadline_s: float | None = None) -> asyncio.Task[None]:
        """A call that hangs by now."""
        call = asyncio.create_task(self.worker.call(self.hang, deadline_s))
        await self.is_hanging()
        return call

    async def hang_too_long(self) -> None:
        """Hang past the deadline of the call."""
        with pytest.raises(NotResponding, match="did not end"):
            await self.worker.call(self.hang)

    async def is_back(self) -> None:
        """Free what hangs, and wait until the thread takes calls again."""
        self.freed.set()
        async with asyncio.timeout(LONG_S):
            while True:
                try:
                    await self.worker.call(lambda: None)
                except NotResponding:
                    await asyncio.sleep(0.001)
                else:
                    return


@pytest.fixture
async def bus() -> AsyncIterator[Bus]:
    made = Bus()
    yield made
    made.freed.set()
    await made.worker.close()


async def refused_at_once(bus: Bus) -> bool:
    """Whether a call is refused before the loop has gone round once."""
    before = asyncio.get_running_loop().create_task(asyncio.sleep(0))
    with pytest.raises(NotResponding, match="still hangs"):
        await bus.worker.call(bus.job("too late"))
    at_once = not before.done()
    await before
    return at_once


async def test_job_is_done_in_the_thread_of_the_bus_and_its_result_comes_back(bus: Bus) -> None:
    threads = {await bus.worker.call(threading.current_thread) for _ in range(3)}
    assert [thread.name for thread in threads] == ["bus bus"]
    assert all(thread.daemon for thread in threads), "the process must be able to end while a transfer hangs"


async def test_error_of_a_job_comes_back_and_the_next_job_is_done(bus: Bus) -> None:
    with pytest.raises(ZeroDivisionError):
        await bus.worker.call(lambda: 1 // 0)
    assert await bus.worker.call(bus.job("next")) == "next"


async def test_timeout_that_the_kernel_reports_is_an_error_like_others(bus: Bus) -> None:
    def time_out() -> None:
        raise OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))

    with pytest.raises(TimeoutError):
        await bus.worker.call(time_out)
    assert await bus.worker.call(bus.job("next")) == "next"


async def test_jobs_are_done_in_the_order_of_their_calls(bus: Bus) -> None:
    await asyncio.gather(*(bus.worker.call(bus.job(str(number)), LONG_S) for number in range(20)))
    assert bus.done == [str(number) for number in range(20)]


async def test_job_that_hangs_raises_at_its_deadline(bus: Bus) -> None:
    began_s = asyncio.get_running_loop().time()
    with pytest.raises(NotResponding, match=r"bus: a transfer did not end within 0\.2 s"):
        await bus.worker.call(bus.hang)
    assert asyncio.get_running_loop().time() - began_s >= DEADLINE_S
    assert not bus.freed.is_set()


async def test_loop_ticks_on_while_a_job_hangs(bus: Bus) -> None:
    ticks = 0
    hanging = await bus.hanging_call(LONG_S)
    for _ in range(20):
        await asyncio.sleep(0.001)
        ticks += not hanging.done()
    assert ticks == 20
    bus.freed.set()
    await hanging


async def test_what_was_queued_behind_a_job_that_hangs_fails_and_is_never_done(bus: Bus) -> None:
    hanging = await bus.hanging_call()
    queued = [asyncio.create_task(bus.worker.call(bus.job("old"), LONG_S)) for _ in range(3)]
    with pytest.raises(NotResponding):
        await hanging
    for call in queued:
        with pytest.raises(NotResponding, match="an earlier transfer hangs"):
            await call
    await bus.is_back()
    assert bus.done == ["hung"]


async def test_call_during_a_hang_is_refused_at_once(bus: Bus) -> None:
    await bus.hang_too_long()
    assert await refused_at_once(bus)
    await bus.is_back()
    assert await bus.worker.call(bus.job("after")) == "after"
    assert bus.done == ["hung", "after"]


@pytest.mark.parametrize("posted", [True, False])
async def test_call_behind_a_stop_or_an_abandoned_call_that_hangs_waits_once_and_then_is_refused_at_once(
    bus: Bus, posted: bool
) -> None:
    if posted:
        bus.worker.post(bus.hang)
        await bus.is_hanging()
    else:
        abandoned = await bus.hanging_call(LONG_S)
        abandoned.cancel()
        with pytest.raises(asyncio.CancelledError):
            await abandoned
    with pytest.raises(NotResponding, match="a transfer did not end"):
        await bus.worker.call(bus.job("old"))
    assert await refused_at_once(bus)
    await bus.is_back()
    assert bus.done == ["hung"]


async def test_call_that_is_cancelled_before_it_began_is_never_done(bus: Bus) -> None:
    hanging = await bus.hanging_call(LONG_S)
    queued = asyncio.create_task(bus.worker.call(bus.job("cancelled"), LONG_S))
    await asyncio.sleep(0)
    queued.cancel()
    with pytest.raises(asyncio.CancelledError):
        await queued
    bus.freed.set()
    await hanging
    assert await bus.worker.call(bus.job("next")) == "next"
    assert bus.done == ["hung", "next"]


async def test_posted_stops_survive_a_hang_and_go_first(bus: Bus) -> None:
    hanging = await bus.hanging_call(LONG_S)
    queued = asyncio.create_task(bus.worker.call(bus.job("drive"), LONG_S))
    await asyncio.sleep(0)
    bus.worker.post(bus.job("stop"))
    bus.worker.post(bus.job("stop again"))
    bus.freed.set()
    await asyncio.gather(hanging, queued)
    assert bus.done == ["hung", "stop", "stop again", "drive"]


async def test_stop_posted_while_calls_are_refused_is_done_when_the_bus_is_back(bus: Bus) -> None:
    await bus.hang_too_long()
    bus.worker.post(bus.job("stop"))
    assert await refused_at_once(bus)
    await bus.is_back()
    assert bus.done == ["hung", "stop"]


async def test_stops_that_pile_up_while_a_bus_hangs_do_not_hold_up_what_comes_after(bus: Bus) -> None:
    bus.worker.post(bus.hang)
    await bus.is_hanging()
    for number in range(100):
        bus.worker.post(bus.job(str(number)))
    await bus.is_back()
    assert bus.done == ["hung", *map(str, range(92, 100))], "the last eight"


async def test_stop_may_be_posted_from_any_thread_and_its_error_is_dropped(bus: Bus) -> None:
    def post() -> None:
        bus.worker.post(lambda: 1 // 0)
        bus.worker.post(bus.job("stop"))

    await asyncio.to_thread(post)
    await bus.worker.call(lambda: None)
    assert bus.done == ["stop"]


async def test_close_does_what_was_posted_and_then_the_last_thing(bus: Bus) -> None:
    await bus.worker.call(bus.job("drive"))
    bus.worker.post(bus.job("stop"))
    await bus.worker.close(bus.job("release"))
    assert bus.done == ["drive", "stop", "release"]


async def test_close_waits_no_longer_than_the_thread_lasts(bus: Bus) -> None:
    await bus.worker.call(bus.job("drive"))
    async with asyncio.timeout(5.0):  # of the 60
        await bus.worker.close(wait_s=60.0)
    assert bus.done == ["drive"]


async def test_close_does_not_wait_for_a_job_that_hangs(bus: Bus) -> None:
    await bus.hang_too_long()
    bus.worker.post(bus.job("stop"))
    async with asyncio.timeout(LONG_S / 2):
        await bus.worker.close(bus.job("release"))
    assert bus.done == []
    bus.freed.set()
    await bus.worker.close(bus.job("release"))
    assert bus.done == ["hung", "stop", "release"], "the stop goes out even then, and each once"


async def test_close_waits_as_long_as_it_is_told_for_a_posted_stop(bus: Bus) -> None:
    await bus.hang_too_long()
    bus.worker.post(bus.job("stop"))
    asyncio.get_running_loop().call_later(2 * CLOSE_WAIT_S, bus.freed.set)
    await bus.worker.close(bus.job("release"), LONG_S)
    assert bus.done == ["hung", "stop", "release"]


async def test_close_waits_no_longer_for_a_patient_worker_than_for_others(bus: Bus) -> None:
    patient = Worker("camera", LONG_S)
    patient.post(bus.hang)
    await bus.is_hanging()
    async with asyncio.timeout(LONG_S / 2):
        await patient.close()
    assert bus.done == []


async def test_closed_worker_refuses_calls_and_forgets_stops(bus: Bus) -> None:
    await bus.worker.call(bus.job("drive"))
    await bus.worker.close(bus.job("release"))
    await bus.worker.close(bus.job("release"))
    bus.worker.post(bus.job("stop"))
    with pytest.raises(NotResponding, match="bus: closed"):
        await bus.worker.call(bus.job("drive"))
    assert bus.done == ["drive", "release"]


async def test_worker_that_was_never_used_has_no_thread_and_nothing_to_release(bus: Bus) -> None:
    threads = threading.active_count()
    unused = Worker("unused")
    await unused.close(bus.job("release"))
    assert threading.active_count() == threads
    assert bus.done == []


async def test_job_that_waited_longer_than_its_deadline_is_not_begun_while_the_loop_stands_still(bus: Bus) -> None:
    """The loop stands still, as in a process that is suspended: only the thread can see that the time is over."""
    calls = [asyncio.create_task(bus.worker.call(job)) for job in (bus.hang, bus.job("old command"))]
    await asyncio.sleep(0)
    assert bus.hangs.wait(LONG_S)
    threading.Event().wait(2 * DEADLINE_S)
    bus.freed.set()
    threading.Event().wait(DEADLINE_S)
    assert bus.done == ["hung"]
    results = await asyncio.gather(*calls, return_exceptions=True)
    assert isinstance(results[1], NotResponding)
    assert await bus.worker.call(bus.job("new command")) == "new command"


async def test_computer_without_threads_refuses_a_call_and_keeps_a_stop_for_later(
    bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_thread(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", no_thread)
        for _ in range(2):
            bus.worker.post(bus.job("stop"))
        with pytest.raises(NotResponding, match="can't start new thread"):
            await bus.worker.call(bus.job("call"))
    assert await bus.worker.call(bus.job("later")) == "later"
    assert bus.done == ["stop", "stop", "later"]
