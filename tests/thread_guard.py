"""A test fails on a thread of wayfarer or of its own that it leaves behind: it would work in the tests that follow."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

import pytest

from wayfarer.waiting_thread import OneCall

PATIENCE_S = 5.0  # with a thread that was told to end
SHARED = "shared"  # begins the name of a thread that ends with a fixture of several tests


@contextmanager
def no_thread_left() -> Iterator[None]:
    """Wait for the threads that began meanwhile, and fail the test if one does not end."""
    before = set(threading.enumerate())
    calls: list[OneCall] = []  # the interpreter lists no such thread
    start = OneCall.start

    def noted(call: OneCall) -> None:
        start(call)
        calls.append(call)

    with patch.object(OneCall, "start", noted):
        yield
    for call in calls:
        call.join(PATIENCE_S)
        if not call.is_over:
            pytest.fail("the test left a call in a thread behind", pytrace=False)
    for thread in set(threading.enumerate()) - before:
        if _is_ours(thread):
            thread.join(PATIENCE_S)
            if thread.is_alive():
                pytest.fail(f"the test left the thread '{thread.name}' behind", pytrace=False)


def _is_ours(thread: threading.Thread) -> bool:
    """Return whether it runs a function of this repository; those of libraries end when they like."""
    if thread.name.startswith(SHARED):
        return False
    target = vars(thread).get("_target")  # gone once it has ended
    return getattr(target, "__module__", "").partition(".")[0] in {"wayfarer", "tests", "benchmarks"}


@pytest.fixture(autouse=True)
def ends_its_threads() -> Iterator[None]:
    """Hold each test to it, with its fixtures."""
    with no_thread_left():
        yield
