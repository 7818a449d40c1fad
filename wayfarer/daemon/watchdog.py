"""Watchdogs: notifies systemd that the rover is well, and stops the wheels when the event loop is blocked.

There are two. systemd's watchdog is fed from the loop (``feed_watchdog``) and restarts a daemon that hangs, after
seconds. The stall guard (``StallGuard``) is a thread that stops the wheels within a fraction of a second, because a
loop that is blocked by a bug cannot stop them. If the interpreter itself is blocked (a library that keeps Python's
global lock, a stopped process), no thread runs either; then the motor board's own timeout stops the wheels.
"""

from __future__ import annotations

import asyncio
import faulthandler
import os
import socket
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import islice
from pathlib import Path
from traceback import walk_stack

from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.errors import one_line
from wayfarer.safety.gate import STALL_LIMIT_S

WHERE_FRAMES = 4  # the innermost calls: the one that blocks, and its callers
NEVER_US = 2.0**64 - 1.0  # what systemd calls infinity
HALT_AGAIN_S = 0.1  # a stop may be lost on the bus; it is repeated for as long as the loop is blocked


class SystemdNotifier:
    """Notifies systemd of the service's state (sd_notify); without systemd it does nothing.

    Nothing here raises or waits: notifying systemd must not disturb control.

    Args:
        address: the socket, as systemd gives it in ``NOTIFY_SOCKET``: a path, or ``@`` and an abstract name.
    """

    def __init__(self, address: str | None) -> None:
        # An abstract socket has a zero byte where its printed name has the @ (unix(7)).
        self._address = "\0" + address[1:] if address and address.startswith("@") else address

    def status(self, text: str) -> None:
        """Show a line in ``systemctl status``."""
        self.tell("STATUS=" + one_line(text))

    def tell(self, message: str) -> None:
        """Send a message of sd_notify(3), such as ``READY=1``."""
        if not self._address:
            return
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
            notify.setblocking(False)
            notify.sendto(message.encode(errors="replace"), self._address)


def watchdog_period_s(environment: Mapping[str, str]) -> float | None:
    """Return the period for feeding systemd's watchdog: a quarter of its limit, so one delay does not cause a restart.

    The limit is ``WATCHDOG_USEC``. None if no watchdog watches this process (sd_watchdog_enabled(3)).
    """
    limit_us, watched = environment.get("WATCHDOG_USEC", ""), environment.get("WATCHDOG_PID", "")
    if watched not in {"", str(os.getpid())} or not limit_us.isdecimal() or not 0.0 < float(limit_us) < NEVER_US:
        return None
    return float(limit_us) / 4e6


async def feed_watchdog(notifier: SystemdNotifier, is_fresh: Callable[[], bool], period_s: float) -> None:
    """Feed systemd's watchdog for ever, but only while ``is_fresh`` says that the tick and the sensors are."""
    while True:
        if is_fresh():
            notifier.tell("WATCHDOG=1")
        await asyncio.sleep(period_s)


class StallGuard:
    """A thread that stops the wheels while the event loop is blocked.

    ``start`` it on the loop when the wheels may turn, call ``beat`` at each control tick, ``stop`` it when they may
    not. After ``limit_s`` without a beat it halts the wheels, at once and every ``HALT_AGAIN_S`` until the next beat,
    and has one line and the stacks of all threads written to stderr: they show what blocks the loop. A stderr that
    blocks holds up no halt.

    Args:
        halt: stops the wheels without waiting, from any thread (``hal.DriveMotors.halt``).
        tell: writes a line to stderr without waiting, from any thread (``StderrWriter.write``).
        recovered: called on the loop after a stall, with its length in seconds, counted from the last beat, and where
            the loop's thread was: the innermost calls, as ``file:line function``, in one line.
        limit_s: how long the loop may be silent; seconds, above the control period.
    """

    def __init__(
        self,
        halt: Callable[[], None],
        tell: Callable[[str], None],
        recovered: Callable[[float, str], None],
        limit_s: float = STALL_LIMIT_S,
    ) -> None:
        self._halt = halt
        self._tell = tell
        self._recovered = recovered
        self._limit_s = limit_s
        self._beat_s = 0.0
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to watch the running loop, unless it already does; the next beat is due within the limit."""
        if self._thread is not None:
            return
        self._loop = asyncio.get_running_loop()
        self._loop_thread = threading.get_ident()
        self._stopped = threading.Event()
        self.beat()
        self._thread = threading.Thread(target=self._watch, args=(self._stopped,), name="stall guard", daemon=True)
        self._thread.start()

    def beat(self) -> None:
        """Record a beat; cheap enough for every tick."""
        self._beat_s = self._loop.time()

    def stop(self) -> None:
        """Stop watching; safe twice. A stop of the wheels that has begun may still be sent."""
        self._stopped.set()
        self._thread = None

    def _watch(self, stopped: threading.Event) -> None:
        time = self._loop.time  # a clock that any thread may read
        while not stopped.wait(self._beat_s + self._limit_s - time()):
            last_beat_s = self._beat_s
            if time() - last_beat_s >= self._limit_s:
                self._halt_until_beat(last_beat_s, stopped)

    def _halt_until_beat(self, last_beat_s: float, stopped: threading.Event) -> None:
        """Keep the wheels still until the loop is back."""
        self._halt()
        where = _where(self._loop_thread)
        self._tell_what_blocks()
        while self._beat_s == last_beat_s and not stopped.wait(HALT_AGAIN_S):
            self._halt()
        with suppress(RuntimeError):  # the loop was closed meanwhile
            self._loop.call_soon_threadsafe(self._recovered, self._beat_s - last_beat_s, where)

    def _tell_what_blocks(self) -> None:
        self._tell(f"wayfarer: the event loop is blocked for {self._limit_s:g} s; wheels stopped")
        with suppress(OSError):  # no file can be made; the wheels matter more
            self._tell(_stacks())


class WatchdogFeed(RunLog):
    """Feeds both from the run's log: each tick is a beat for the guard; at the first, systemd gets "ready"."""

    def __init__(self, notifier: SystemdNotifier, guard: StallGuard) -> None:
        self._notifier = notifier
        self._guard = guard
        self._ready = False

    def tick(self, record: TickRecord) -> None:  # noqa: ARG002
        """Beat."""
        if not self._ready:
            self._ready = True
            self._guard.start()
            self._notifier.tell("READY=1")
            self._notifier.status("Disarmed")
        self._guard.beat()

    def event(self, name: str, t_s: float, **details: object) -> None:  # noqa: ARG002
        """Set the text for systemctl; after the final stop the guard is no longer needed."""
        if name == "wheels_stopped":
            self._guard.stop()
            self._notifier.tell("STOPPING=1")
        elif name in {"arming", "armed", "disarmed", "manual", "manual_ended", "health"}:
            self._notifier.status(str(details.get("text", name)))

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002
        """Show systemd how the run ended."""
        self._notifier.status(text)


def _where(thread: int) -> str:
    """Return the innermost calls of a thread, the innermost first; no source file is read for it."""
    innermost = sys._current_frames().get(thread)
    calls = islice(walk_stack(innermost), WHERE_FRAMES) if innermost is not None else ()
    return " < ".join(f"{_short(frame.f_code.co_filename)}:{line} {frame.f_code.co_qualname}" for frame, line in calls)


def _short(file: str) -> str:
    return "/".join(Path(file).parts[-2:])


def _stacks() -> str:
    """Return the stacks of all threads. They are written to memory first.

    ``faulthandler`` holds Python's lock while it writes, so a stderr that blocks would stop all threads, also the stall
    guard.
    """
    with os.fdopen(os.memfd_create("stacks"), "rb") as memory:
        faulthandler.dump_traceback(memory)
        memory.seek(0)
        return memory.read().decode(errors="replace").rstrip()
