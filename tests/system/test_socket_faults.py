"""The control socket of a real daemon is abused."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress

from tests.system.hil_setup import Site
from tests.system.measures import jitter, now_s

QUIET_S = ABUSE_S = 2.5
CLIENTS = 1000
LONG_LINE_BYTES = 1_000_000_000
PIECE_BYTES = 1_000_000
PAUSE_S = 0.05
AGAIN_S = 0.01  # without it the abuse would take a core away from the bench, whose answers the ticks wait for
JITTER_S = 0.01


def test_socket_that_is_abused_delays_no_tick(site: Site) -> None:
    site.armed()
    quiet_s = now_s()
    time.sleep(QUIET_S)
    abuse_s = now_s()
    ends_s = abuse_s + ABUSE_S
    counts = abuse(site, ends_s)
    times_s = site.ticks_beyond(ends_s)
    before, after = jitter(times_s, quiet_s, abuse_s), jitter(times_s, abuse_s, ends_s)
    print(f"jitter of the tick, median / p95 / worst: {before} before, {after} with {counts}")
    assert all(counts.values())
    assert after.median_s - before.median_s < JITTER_S
    assert site.status()["mode"] == "armed", "the crowd keeps nobody out"
    site.drives_on()


# -- abuse -------------------------------------------------------------------------------------------------------------


def abuse(site: Site, ends_s: float) -> dict[str, int]:
    """Do everything at once until a time, and return how often each thing was done."""
    counts: dict[str, int] = {}

    def again_and_again(name: str, do: Callable[[socket.socket], None]) -> None:
        counts[name] = 0
        while now_s() < ends_s:
            with suppress(OSError), socket.socket(socket.AF_UNIX) as line:
                line.settimeout(1.0)
                line.connect(str(site.socket))
                counts[name] += 1
                do(line)
            time.sleep(AGAIN_S)

    threads = [threading.Thread(target=again_and_again, args=each) for each in ABUSES.items()]
    threads.append(threading.Thread(target=crowd, args=(site, ends_s, counts)))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return counts


def garbage(line: socket.socket) -> None:
    for _ in range(10):
        line.sendall(os.urandom(1000) + b"\n")
        line.recv(1000)
        time.sleep(PAUSE_S)


def long_line(line: socket.socket) -> None:
    piece = b"x" * PIECE_BYTES
    for _ in range(LONG_LINE_BYTES // PIECE_BYTES):  # it is closed long before
        line.sendall(piece)


def half_line(line: socket.socket) -> None:
    line.sendall(b'{"do": "st')
    time.sleep(0.5)


def byte_after_byte(line: socket.socket) -> None:
    for _ in range(20):
        line.sendall(b" ")
        time.sleep(PAUSE_S)


ABUSES = {"garbage": garbage, "1 GB line": long_line, "half line": half_line, "byte after byte": byte_after_byte}


def crowd(site: Site, ends_s: float, counts: dict[str, int]) -> None:
    """Connect a thousand clients that say nothing, spread over the time."""
    pause_s = (ends_s - now_s()) / CLIENTS
    with ExitStack() as stack:
        for number in range(CLIENTS):
            line = stack.enter_context(socket.socket(socket.AF_UNIX))
            with suppress(OSError):
                line.connect(str(site.socket))
                counts["client"] = number + 1
            time.sleep(pause_s)
