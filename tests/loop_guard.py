"""An async test fails on tasks that it leaves running, and on an event loop that was blocked.

Every loop that is run by ``asyncio.Runner`` or ``asyncio.run`` is checked when the runner ends: that of a test which
pytest-asyncio runs, that of ``tests/virtual.py``, and any that a test runs. The first two also measure their turns: all
callbacks that are run without a look for others. What counts is processor time, so that a busy computer makes no test
fail; a callback that sleeps uses none, and ruff refuses ``time.sleep``.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import cast

import pytest

from wayfarer.simhal.clock.schedule import Schedule
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

# The longest turn of any test, with the imports that it brings, is 0.06 s. A worker that had run thousands of tests
# once spent 0.5 s in one turn, most likely on a full garbage collection.
BLOCKED_S = 2.0


class WatchedLoop(asyncio.SelectorEventLoop):
    """asyncio's own loop, which measures its turns."""

    longest_turn_s = 0.0

    def _run_once(self) -> None:
        began_s = time.thread_time()
        super()._run_once()  # type: ignore[misc]
        took_s = time.thread_time() - began_s
        self.longest_turn_s = max(self.longest_turn_s, took_s)


class WatchedSchedule(Schedule):
    """Measures the turns of a virtual loop: what it does at one instant."""

    longest_turn_s = 0.0

    def run(self) -> bool:
        self._began_s = time.thread_time()
        try:
            return super().run()
        finally:
            self._end_turn()

    def _jump(self) -> bool:
        self._end_turn()
        return super()._jump()

    def _end_turn(self) -> None:
        now_s = time.thread_time()
        self.longest_turn_s = max(self.longest_turn_s, now_s - self._began_s)
        self._began_s = now_s


class WatchedVirtualLoop(VirtualLoop):
    """The virtual loop, which measures its turns."""

    def __init__(self) -> None:
        super().__init__(WatchedSchedule)

    @property
    def longest_turn_s(self) -> float:
        return cast(WatchedSchedule, self.clock).longest_turn_s


def pytest_asyncio_loop_factories() -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """The loop of every async test."""
    return {"watched": WatchedLoop}


def check(loop: asyncio.AbstractEventLoop) -> None:
    """Fail the test whose loop this was."""
    left = sorted(task.get_name() for task in asyncio.all_tasks(loop) if not task.cancelling())
    if left:
        pytest.fail(f"tasks were left running: {', '.join(left)}", pytrace=False)
    blocked_s: float = getattr(loop, "longest_turn_s", 0.0)
    if blocked_s > BLOCKED_S:
        pytest.fail(f"the loop was blocked for {blocked_s:.2f} s of the processor's time", pytrace=False)


_exit = asyncio.Runner.__exit__


def _checked_exit(
    runner: asyncio.Runner, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
) -> None:
    try:
        if kind is None:
            check(runner.get_loop())
    finally:
        _exit(runner, kind, error, trace)


asyncio.Runner.__exit__ = _checked_exit  # type: ignore[assignment, method-assign]
