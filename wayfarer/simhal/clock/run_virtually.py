"""Runs a coroutine in virtual time, from wherever it is called."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from wayfarer.simhal.clock.virtual_loop import VirtualLoop

T = TypeVar("T")


def run_virtually(
    main: Callable[[], Coroutine[Any, Any, T]], loop_factory: Callable[[], VirtualLoop] = VirtualLoop
) -> T:
    """Run ``main`` on a loop of virtual time to its end, and return its result.

    A notebook runs its cells on an event loop, and a thread has one running loop at most: there it is another
    thread that runs ``main``, while this one waits.
    """
    if asyncio._get_running_loop() is None:
        return _run(main, loop_factory)
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(_run, main, loop_factory).result()


def _run(main: Callable[[], Coroutine[Any, Any, T]], loop_factory: Callable[[], VirtualLoop]) -> T:
    with asyncio.Runner(loop_factory=loop_factory) as runner:
        return runner.run(main())
