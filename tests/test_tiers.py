"""The suite guards itself: a unit test starts no process, and none leaves a task or a thread, or blocks its loop."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import subprocess
import threading
import time
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from tests import loop_guard, thread_guard
from tests.loop_guard import WatchedLoop
from tests.thread_guard import no_thread_left
from tests.virtual import run_virtually

Main = Callable[[Coroutine[Any, Any, None]], None]

STARTS: dict[str, Callable[[], object]] = {
    "subprocess": lambda: subprocess.run(["true"], check=True),
    "shell": lambda: os.system("true"),
    "fork": os.fork,
    "asyncio": lambda: asyncio.run(asyncio.create_subprocess_exec("true")),
    "spawned worker": lambda: multiprocessing.get_context("spawn").Process(target=print).start(),
    "forked worker": lambda: multiprocessing.get_context("fork").Process(target=print).start(),
}


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_unit_test_that_starts_a_process_fails_with_the_marker_that_it_needs(start: Callable[[], object]) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"^a unit test starts no process: mark it @pytest\.mark\.process$"):
        start()


def run_watched(main: Coroutine[Any, Any, None]) -> None:
    """Run as pytest-asyncio does."""
    with asyncio.Runner(loop_factory=WatchedLoop) as runner:
        runner.run(main)


async def leave_a_task() -> None:
    task = asyncio.create_task(asyncio.sleep(60.0), name="forgotten")
    assert not task.done()


async def work_for(seconds: float) -> None:
    ends_s = time.thread_time() + seconds
    while time.thread_time() < ends_s:
        pass


@pytest.mark.parametrize("run", [run_virtually, run_watched])
def test_task_that_is_left_running_and_a_blocked_loop_fail(run: Main, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(pytest.fail.Exception, match=r"^tasks were left running: forgotten$"):
        run(leave_a_task())
    monkeypatch.setattr(loop_guard, "BLOCKED_S", 0.02)
    with pytest.raises(pytest.fail.Exception, match=r"^the loop was blocked for 0\.0\d s of the processor's time$"):
        run(work_for(0.03))


async def test_async_tests_are_watched() -> None:
    assert isinstance(asyncio.get_running_loop(), WatchedLoop)


def test_thread_that_does_not_end_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thread_guard, "PATIENCE_S", 0.01)
    ends = threading.Event()
    with pytest.raises(pytest.fail.Exception, match="left the thread 'forgotten' behind"), no_thread_left():
        threading.Thread(target=lambda: ends.wait(), name="forgotten", daemon=True).start()
    ends.set()
