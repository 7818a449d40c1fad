"""An async test that leaves a task running or blocks its loop fails."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from tests import loop_guard
from tests.loop_guard import WatchedLoop
from tests.virtual import run_virtually

pytest_plugins = ["pytester"]

Main = Callable[[Coroutine[Any, Any, None]], None]


def run_watched(main: Coroutine[Any, Any, None]) -> None:
    """Run as pytest-asyncio does."""
    with asyncio.Runner(loop_factory=WatchedLoop) as runner:
        runner.run(main)


LOOPS: dict[str, Main] = {"in virtual time": run_virtually, "on asyncio's loop": run_watched}


async def leave_a_task(*, cancelled: bool = False) -> None:
    task = asyncio.create_task(asyncio.sleep(60.0), name="forgotten")
    await asyncio.sleep(0.0)
    if cancelled:
        task.cancel()


async def work_for(seconds: float) -> None:
    ends_s = time.thread_time() + seconds
    while time.thread_time() < ends_s:
        pass


@pytest.mark.parametrize("run", [*LOOPS.values(), asyncio.run], ids=[*LOOPS, "in asyncio.run"])
def test_task_that_is_left_running_fails(run: Main) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"^tasks were left running: forgotten$"):
        run(leave_a_task())
    run(leave_a_task(cancelled=True))


@pytest.mark.parametrize("run", LOOPS.values(), ids=LOOPS)
def test_blocked_loop_fails(run: Main, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop_guard, "BLOCKED_S", 0.02)
    run(work_for(0.01))
    with pytest.raises(pytest.fail.Exception, match=r"^the loop was blocked for 0\.0\d s of the processor's time$"):
        run(work_for(0.03))


def test_error_of_a_test_is_told_and_not_what_it_left() -> None:
    async def fails() -> None:
        await leave_a_task()
        raise ZeroDivisionError

    for run in LOOPS.values():
        with pytest.raises(ZeroDivisionError):
            run(fails())


ASYNC_TESTS = """
import asyncio
import pytest
from tests.loop_guard import WatchedLoop

async def test_tidy():
    assert isinstance(asyncio.get_running_loop(), WatchedLoop)
    await asyncio.create_task(asyncio.sleep(0.0))

async def test_forgetful():
    asyncio.create_task(asyncio.sleep(60.0), name="forgotten")

@pytest.fixture
async def background():
    task = asyncio.create_task(asyncio.sleep(60.0))
    yield
    task.cancel()

async def test_with_a_task_of_a_fixture(background): pass
"""


def test_every_async_test_is_watched(pytester: pytest.Pytester) -> None:
    pytester.makeconftest("from tests.loop_guard import pytest_asyncio_loop_factories")
    pytester.makeini("[pytest]\nasyncio_mode = auto\nasyncio_default_fixture_loop_scope = function")
    pytester.makepyfile(ASYNC_TESTS)
    done = pytester.runpytest_inprocess("-p", "no:cacheprovider")
    done.assert_outcomes(passed=3, errors=1)
    done.stdout.fnmatch_lines(["*ERROR at teardown of test_forgetful*", "tasks were left running: forgotten"])
