"""Being watched: what systemd is told, and that the wheels stop while the event loop stands still."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.daemon.conftest import Listener
from tests.virtual import virtual
from wayfarer.daemon.stderr_writer import StderrWriter
from wayfarer.daemon.watchdog import StallGuard, SystemdNotifier, feed_watchdog, watchdog_period_s


def test_each_word_reaches_systemd_as_it_expects(listener: Listener) -> None:
    notifier = SystemdNotifier(listener.socket.getsockname())
    notifier.tell("READY=1")
    notifier.status("armed,\n3 m travelled")
    notifier.tell("WATCHDOG=1")
    notifier.status("half a character: \ud83e")
    notifier.tell("STOPPING=1")
    told = ["READY=1", "STATUS=armed, 3 m travelled", "WATCHDOG=1", "STATUS=half a character: ?", "STOPPING=1"]
    assert listener.heard() == told


def test_abstract_socket_is_named_with_an_at_sign() -> None:
    name = f"wayfarer-test-{os.getpid()}"
    listener = Listener(f"\0{name}")
    SystemdNotifier(f"@{name}").tell("READY=1")
    assert listener.heard() == ["READY=1"]
    listener.socket.close()


@pytest.mark.parametrize("address", [None, "", "/nowhere/notify", "@nobody-listens-here", "/" + 200 * "x"])
def test_without_a_listener_nothing_is_raised(address: str | None) -> None:
    SystemdNotifier(address).tell("READY=1")


def test_full_socket_makes_nobody_wait(listener: Listener) -> None:
    notifier = SystemdNotifier(listener.socket.getsockname())
    for _ in range(5000):
        notifier.tell("WATCHDOG=1")
    assert 0 < len(listener.heard()) < 5000


@pytest.mark.parametrize(
    ("environment", "period_s"),
    [
        ({"WATCHDOG_USEC": "10000000"}, 2.5),
        ({"WATCHDOG_USEC": "10000000", "WATCHDOG_PID": str(os.getpid())}, 2.5),
        ({"WATCHDOG_USEC": "10000000", "WATCHDOG_PID": "1"}, None),
        ({"WATCHDOG_USEC": "0"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
        ({"WATCHDOG_USEC": str(2**64 - 1)}, None),  # systemd's infinity
        ({"WATCHDOG_USEC": "9" * 5_000}, None),
        ({}, None),
    ],
)
def test_watchdog_period_is_a_quarter_of_the_limit(environment: dict[str, str], period_s: float | None) -> None:
    assert watchdog_period_s(environment) == period_s


@virtual
async def test_watchdog_is_fed_only_while_all_is_fresh(listener: Listener) -> None:
    notifier = SystemdNotifier(listener.socket.getsockname())
    time = asyncio.get_running_loop().time
    stale_from_s = time() + 5.0
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(20.0):
            await feed_watchdog(notifier, lambda: time() < stale_from_s, 2.5)
    assert listener.heard() == ["WATCHDOG=1"] * 2


class Wheels:
    """Notes when the guard stopped them."""

    def __init__(self) -> None:
        self._time = asyncio.get_running_loop().time
        self.halts_s: list[float] = []
        self.recoveries_s: list[float] = []
        self.places: list[str] = []
        self.lines = StderrWriter()

    def halt(self) -> None:
        self.halts_s.append(self._time())

    def recovered(self, stall_s: float, where: str) -> None:
        self.recoveries_s.append(stall_s)
        self.places.append(where)

    def guard(self, limit_s: float = 0.4) -> StallGuard:
        """A guard with more patience than the rover's, for a busy test machine."""
        return StallGuard(self.halt, self.lines.write, self.recovered, limit_s)

    @contextmanager
    def guarded(self, limit_s: float = 0.4) -> Iterator[StallGuard]:
        guard = self.guard(limit_s)
        guard.start()
        yield guard
        guard.stop()
        self.lines.close()


def block(seconds_s: float) -> None:
    """Hold the loop as a bug would."""
    threading.Event().wait(seconds_s)


async def beat_for(guard: StallGuard, seconds_s: float) -> None:
    for _ in range(round(seconds_s / 0.05)):
        guard.beat()
        await asyncio.sleep(0.05)


async def test_blocked_loop_has_its_wheels_stopped_again_and_again(capfd: pytest.CaptureFixture[str]) -> None:
    wheels = Wheels()
    time = asyncio.get_running_loop().time
    began_s = time()
    with wheels.guarded() as guard:
        block(1.0)
        ended_s = time()
        await beat_for(guard, 0.2)
        while_blocked_s = [t_s - began_s for t_s in wheels.halts_s if t_s < ended_s]
        assert while_blocked_s[0] >= 0.4
        assert len(while_blocked_s) >= 3
        assert wheels.recoveries_s == [pytest.approx(ended_s - began_s, abs=0.1)]
        block(0.8)
        await beat_for(guard, 0.2)
    assert len(wheels.recoveries_s) == 2
    where, _ = wheels.places
    assert "daemon/test_watchdog.py:" in where, where
    assert " block < " in where, "taken while it stood still, and who called"
    assert "\n" not in where
    told = capfd.readouterr().err
    assert told.count("the event loop is blocked") == 2, "each stall is told once"
    assert "in block" in told, "the stacks show what blocks"


async def test_beating_loop_is_left_alone() -> None:
    wheels = Wheels()
    with wheels.guarded(limit_s=1.0) as guard:
        await beat_for(guard, 1.5)
    assert wheels.halts_s == []


async def test_stopped_guard_watches_no_more_and_can_be_started_again(capfd: pytest.CaptureFixture[str]) -> None:
    wheels = Wheels()
    guard = wheels.guard()
    guard.stop()
    guard.start()
    guard.stop()
    guard.stop()
    block(0.6)
    assert wheels.halts_s == []
    guard.start()
    block(0.6)
    guard.stop()
    wheels.lines.close()
    assert wheels.halts_s != []


async def test_start_twice_makes_one_watcher() -> None:
    with Wheels().guarded() as guard:
        guard.start()
        assert [thread.name for thread in threading.enumerate()].count("stall guard") == 1


async def test_stderr_that_nobody_reads_holds_up_no_halt(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.write(writing, b"." * 65_536)  # what a pipe holds until somebody reads
    with os.fdopen(writing, "w") as stalled:
        monkeypatch.setattr("sys.stderr", stalled)
        wheels = Wheels()
        with wheels.guarded(limit_s=0.2):
            block(1.0)
        os.close(reading)  # what waits for it is woken by an error
        assert len(wheels.halts_s) >= 4


async def test_wheels_are_stopped_before_stacks_are_taken_and_again_where_no_memory_is_left_for_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    halts_before: list[int] = []

    def refuse(_: str) -> int:
        halts_before.append(len(wheels.halts_s))
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(os, "memfd_create", refuse)
    wheels = Wheels()
    with wheels.guarded():
        block(0.9)
    assert halts_before == [1]
    assert len(wheels.halts_s) >= 2


async def test_without_stderr_the_wheels_are_stopped_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", None)
    wheels = Wheels()
    with wheels.guarded():
        block(0.9)
    assert len(wheels.halts_s) >= 2
