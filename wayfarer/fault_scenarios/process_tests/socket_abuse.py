"""The control socket: abused, asked for what cannot be, and wanted by a second daemon."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress

from wayfarer.daemon.socket.protocol import Refused
from wayfarer.fault_scenarios.process_tests.hil_setup import HilSetup, site, wait_for
from wayfarer.fault_scenarios.process_tests.jitter import jitter
from wayfarer.fault_scenarios.process_tests.procedure import Observed, procedure
from wayfarer.fault_scenarios.scenario import Reached

QUIET_S = ABUSE_S = 2.5
CLIENTS = 1000
LONG_LINE_BYTES = 1_000_000_000
PIECE_BYTES = 1_000_000
PAUSE_S = 0.05
AGAIN_S = 0.01  # without it the abuse would take a core away from the bench, whose answers the ticks wait for
JITTER_S = 0.01
TRIES = 20
ALREADY_RUNNING = 75  # EX_TEMPFAIL of sysexits.h


@procedure(
    "socket-abuse", 50, "garbage, a line of 1 GB, half lines, byte after byte, 1,000 clients, all at once",
    asked="bounded line, client cap, timeout; control loop jitter unchanged; 10 ms", expected=Reached.NONE,
)  # fmt: skip
def socket_abuse(found: Observed) -> None:
    """Abuse the socket of a rover that drives, and compare its ticks with those before."""
    with site() as where:
        where.armed()
        quiet_s = time.monotonic()
        time.sleep(QUIET_S)
        abuse_s = time.monotonic()
        counts = _abuse(where, abuse_s + ABUSE_S)
        ends_s = abuse_s + ABUSE_S
        times_s = where.ticks_beyond(ends_s)
        before, after = jitter(times_s, quiet_s, abuse_s), jitter(times_s, abuse_s, ends_s)
        found.demand(after.median_s - before.median_s < JITTER_S, f"the ticks: {before}, then {after}")
        found.demand(_asked_again_and_again(where)["mode"] == "armed", "it is not armed any more")
        found.demand(where.drives, "the wheels stand")
        found.changed = ", ".join(f"{name} {count}x" for name, count in counts.items())
        found.demand(all(counts.values()), f"not all was tried: {counts}")
        found.remark = f"jitter of the tick, median / p95 / worst: {before} before, {after} with it"


@procedure(
    "wrong-state", 51, "verbs that are right, at the wrong time",
    asked="typed refusal, no state change", expected=Reached.NONE,
)  # fmt: skip
def wrong_state(found: Observed) -> None:
    """Ask for what cannot be: disarmed, armed, and with a fault that lasts."""
    with site() as where:
        where.daemon()
        _refused(where, "disarmed", ("resume", "hold"), found)
        _refused(where, "disarmed", ("goal",), found, heading_deg=1.0)
        where.ask("arm", heading_deg=0.0)
        wait_for("it is armed", lambda: where.status()["mode"] == "armed")
        _refused(where, "armed", ("arm", "resume"), found)
        where.bench("silence", bus="/dev/i2c-1", address=0x60)
        wait_for("a fault", lambda: "compass_lost" in where.status()["conditions"])
        wait_for("it is disarmed", lambda: where.status()["mode"] == "disarmed")
        _refused(where, "disarmed", ("arm",), found)
        found.changed = "7 refusals"


@procedure(
    "second-daemon", 52, "a second daemon is started; then a stale socket lies there",
    asked="lock; second exits code 75-style, first untouched; start", expected=Reached.NONE,
)  # fmt: skip
def second_daemon(found: Observed) -> None:
    """Start a daemon beside one that drives; then kill that one, which leaves its socket, and start another."""
    with site() as where:
        first = where.armed()
        second = where.run("run", "--config", where.config, "--logs", where.logs)
        found.demand(second.returncode == ALREADY_RUNNING, f"exit code {second.returncode}")
        found.demand(str(first.pid) in second.stderr, f"it does not say who runs: {second.stderr}")
        found.demand(where.status()["mode"] == "armed" and where.drives, "the first is not as it was")
        found.demand(len(list(where.logs.iterdir())) == 1, "the second has made a run")
        first.kill()
        first.wait()
        found.demand(where.socket.exists(), "there is no stale socket")
        where.daemon()
        found.demand(where.status()["mode"] == "disarmed", "the next one is not disarmed")
        found.changed, found.cause = "the second start", f"exit code {second.returncode}"


def _refused(where: HilSetup, mode: str, verbs: tuple[str, ...], found: Observed, **details: object) -> None:
    """See that these are refused with a reason, and change nothing."""
    for verb in verbs:
        try:
            where.ask(verb, **details)
            found.problems.append(f"{verb} was done while {mode}")
        except Refused as refused:
            found.cause = str(refused)
        found.demand(where.status()["mode"] == mode, f"{verb} changed the mode from {mode}")


# -- abuse -------------------------------------------------------------------------------------------------------------


def _abuse(where: HilSetup, ends_s: float) -> dict[str, int]:
    """Do everything at once until a time, and return how often each thing was done."""
    counts: dict[str, int] = {}

    def again_and_again(name: str, do: Callable[[socket.socket], None]) -> None:
        counts[name] = 0
        while time.monotonic() < ends_s:
            with suppress(OSError), socket.socket(socket.AF_UNIX) as line:
                line.settimeout(1.0)
                line.connect(str(where.socket))
                counts[name] += 1
                do(line)
            time.sleep(AGAIN_S)

    threads = [threading.Thread(target=again_and_again, args=each) for each in ABUSES.items()]
    threads.append(threading.Thread(target=_crowd, args=(where, ends_s, counts)))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return counts


def _garbage(line: socket.socket) -> None:
    for _ in range(10):
        line.sendall(os.urandom(1000) + b"\n")
        line.recv(1000)
        time.sleep(PAUSE_S)


def _long_line(line: socket.socket) -> None:
    piece = b"x" * PIECE_BYTES
    for _ in range(LONG_LINE_BYTES // PIECE_BYTES):  # it is closed long before
        line.sendall(piece)


def _half_line(line: socket.socket) -> None:
    line.sendall(b'{"do": "st')
    time.sleep(0.5)


def _byte_after_byte(line: socket.socket) -> None:
    for _ in range(20):
        line.sendall(b" ")
        time.sleep(PAUSE_S)


ABUSES = {"garbage": _garbage, "1 GB line": _long_line, "half line": _half_line, "byte after byte": _byte_after_byte}


def _crowd(where: HilSetup, ends_s: float, counts: dict[str, int]) -> None:
    """Connect a thousand clients that say nothing, spread over the time."""
    pause_s = (ends_s - time.monotonic()) / CLIENTS
    with ExitStack() as stack:
        for number in range(CLIENTS):
            line = stack.enter_context(socket.socket(socket.AF_UNIX))
            with suppress(OSError):
                line.connect(str(where.socket))
                counts["client"] = number + 1
            time.sleep(pause_s)


def _asked_again_and_again(where: HilSetup) -> dict[str, object]:
    """Return the status as somebody gets it who is pushed aside by the crowd, and tries again."""
    for _ in range(TRIES):
        with suppress(Refused):
            return where.status()
    return where.status()
