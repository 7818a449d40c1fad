"""Running in virtual time: a coroutine, or a test; and asking in it for what starts wheels."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from tests.loop_guard import WatchedVirtualLoop
from wayfarer.safety.permission import Asked

P = ParamSpec("P")
T = TypeVar("T")


def run_virtually(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine in virtual time."""
    with asyncio.Runner(loop_factory=WatchedVirtualLoop) as runner:
        return runner.run(main)


def virtual(test: Callable[P, Coroutine[Any, Any, T]]) -> Callable[P, T]:
    """Run a test, or a part of one, in virtual time."""

    @wraps(test)
    def run(*args: P.args, **kwargs: P.kwargs) -> T:
        return run_virtually(test(*args, **kwargs))

    return run


def asked() -> Asked:
    """A permission of now."""
    return Asked(asyncio.get_running_loop().time())
