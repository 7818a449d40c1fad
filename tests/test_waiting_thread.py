"""A call that hangs holds one thread, however often it is begun; what was begun meanwhile is done once more."""

from __future__ import annotations

import _thread
import asyncio
import threading
from collections.abc import Iterator

import pytest

from wayfarer.daemon.daemon import THREADS, DaemonLoop
from wayfarer.waiting_thread import OneCall

PATIENCE_S = 5.0


@pytest.fixture
def answers() -> Iterator[threading.Event]:
    """When the disk answers."""
    event = threading.Event()
    yield event
    event.set()


def test_call_that_hangs_holds_one_thread_and_is_done_once_more(answers: threading.Event) -> None:
    said: list[int] = []
    newest = [0]

    def call() -> None:
        said.append(newest[0])
        answers.wait(PATIENCE_S)

    writing = OneCall(call)
    before = _thread._count()
    for newest[0] in range(100):
        writing.start()
        while not said:
            pass
        assert _thread._count() <= before + 1
    writing.join(0.01)
    assert not writing.is_over
    answers.set()
    writing.join(PATIENCE_S)
    assert writing.is_over
    assert said == [0, 99]
    writing.start()
    writing.join(PATIENCE_S)
    assert said == [0, 99, 99]


def test_thread_that_ended_before_its_first_line_keeps_the_next_call_from_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As it does without memory."""
    called = threading.Event()
    call = OneCall(called.set)
    with monkeypatch.context() as patch:
        patch.setattr(_thread, "start_new_thread", lambda _run, _args: 7)
        call.start()
    call.join(0.01)
    assert not call.is_over
    call.start()
    call.join(PATIENCE_S)
    assert called.is_set()


def test_thread_that_cannot_be_had_is_told_and_the_next_call_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise RuntimeError("can't start new thread")

    called = threading.Event()
    call = OneCall(called.set)
    with monkeypatch.context() as patch:
        patch.setattr(_thread, "start_new_thread", fails)
        with pytest.raises(RuntimeError):
            call.start()
    assert call.is_over
    call.start()
    call.join(PATIENCE_S)
    assert called.is_set()


def test_loop_of_a_daemon_has_no_more_threads_than_a_few_on_a_disk_that_hangs(answers: threading.Event) -> None:
    """Each arming looks at the disk, and is refused after some seconds."""
    begun: list[int] = []

    def look(number: int) -> int:
        begun.append(number)
        answers.wait(PATIENCE_S)
        return number

    async def ask() -> None:
        before = _thread._count()
        for number in range(50):
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0.001):
                    await asyncio.to_thread(look, number)
            assert _thread._count() <= before + THREADS
        answers.set()
        async with asyncio.timeout(PATIENCE_S):
            assert await asyncio.to_thread(look, 50) == 50
            with pytest.raises(ZeroDivisionError):
                await asyncio.to_thread(lambda: 1 / 0)

    with asyncio.Runner(loop_factory=DaemonLoop) as runner:
        runner.run(ask())
    assert (len(begun), begun[-1]) == (THREADS + 1, 50), "what nobody waited for any more was not begun"
