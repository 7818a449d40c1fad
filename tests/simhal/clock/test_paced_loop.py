"""The paced loop: the same order as in virtual time, at the speed that is asked for, and reachable by other threads."""

# ruff: noqa: TID251 - the clock is what is tested
from __future__ import annotations

import asyncio
import time
from functools import partial
from threading import Thread, Timer

import pytest

from tests.simhal.clock.programs import PROGRAMS, Program, trace_of
from wayfarer.errors import NothingScheduled
from wayfarer.simhal.clock.virtual_loop import CATCH_UP_S, Pace, PacedLoop

pytestmark = pytest.mark.process  # it waits for the clock

FAST = 1e6


def took_s(loop: PacedLoop, virtual_s: float) -> float:
    """Sleep in virtual time; return how long that was by the clock."""
    began_s = time.monotonic()
    loop.run_until_complete(asyncio.sleep(virtual_s))
    return time.monotonic() - began_s


@pytest.fixture
def pace() -> Pace:
    return Pace(FAST)


@pytest.fixture
def loop(pace: Pace) -> PacedLoop:
    return PacedLoop(pace)  # type: ignore[abstract]


@pytest.mark.parametrize("program", PROGRAMS)
def test_program_runs_as_in_virtual_time(program: Program) -> None:
    paced = partial(PacedLoop, Pace(FAST))  # type: ignore[abstract]
    assert trace_of(program, paced) == trace_of(program)


def test_time_goes_at_its_speed_and_stands_where_nothing_can_happen(loop: PacedLoop, pace: Pace) -> None:
    pace.speed = 20.0
    assert 0.2 - 1.1 * CATCH_UP_S < took_s(loop, 4.0) < 2.0
    assert loop.time() == 4.0
    with pytest.raises(NothingScheduled):
        loop.run_until_complete(loop.create_future())


def test_change_of_speed_counts_at_once(loop: PacedLoop, pace: Pace) -> None:
    def hurry() -> None:
        pace.speed = FAST
        loop.wake()

    pace.speed = 0.1
    Timer(0.05, hurry).start()
    assert took_s(loop, 100.0) < 2.0


def test_pause_lets_callbacks_of_other_threads_run_but_no_timer(loop: PacedLoop, pace: Pace) -> None:
    seen: list[tuple[str, float]] = []

    def from_outside() -> None:
        loop.call_soon_threadsafe(lambda: seen.append(("asked", loop.time())))
        time.sleep(0.1)
        pace.paused = False
        seen.append(("goes on", loop.time()))
        loop.wake()

    pace.paused = True
    thread = Thread(target=from_outside)
    thread.start()
    loop.run_until_complete(asyncio.sleep(5.0))
    thread.join()
    assert seen == [("asked", 0.0), ("goes on", 0.0)]


def test_task_of_another_thread_is_done_at_the_virtual_time_then(loop: PacedLoop, pace: Pace) -> None:
    async def what_time() -> float:
        return loop.time()

    answers: list[float] = []

    def ask() -> None:
        answers.append(asyncio.run_coroutine_threadsafe(what_time(), loop).result(5.0))

    pace.speed = 10.0
    thread = Thread(target=ask)
    loop.call_later(1.0, thread.start)
    loop.run_until_complete(asyncio.sleep(4.0))
    thread.join()
    assert answers == [1.0]


def test_long_delay_is_not_made_up_for(loop: PacedLoop, pace: Pace) -> None:
    """A computer that was busy is no reason for a burst of virtual time."""

    async def steps() -> None:
        for _ in range(30):
            await asyncio.sleep(0.1)

    pace.speed = 10.0
    loop.call_later(1.0, time.sleep, 0.3)
    began_s = time.monotonic()
    loop.run_until_complete(steps())
    # At the beginning and after the delay it may hurry a little. Were the delay made up for, it would take 0.4 s.
    assert time.monotonic() - began_s > 0.3 + 0.3 - 2.2 * CATCH_UP_S
