"""The guard finds a thread that a test leaves behind, and waits for one that ends."""

from __future__ import annotations

import threading

import pytest

from tests import thread_guard
from tests.thread_guard import no_thread_left


def start(until: threading.Event) -> threading.Thread:
    thread = threading.Thread(target=lambda: until.wait(), name="forgotten", daemon=True)
    thread.start()
    return thread


def test_thread_that_does_not_end_fails_the_test(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thread_guard, "PATIENCE_S", 0.01)
    ends = threading.Event()
    with pytest.raises(pytest.fail.Exception, match="left the thread 'forgotten' behind"), no_thread_left():
        start(ends)
    ends.set()


def test_thread_that_was_told_to_end_is_waited_for() -> None:
    ends = threading.Event()
    with no_thread_left():
        thread = start(ends)
        threading.Timer(0.05, ends.set).start()
    assert not thread.is_alive()
