"""``wayfarer run --sim`` as a process: how soon it is ready, what it takes, and how evenly it ticks while it drives."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from statistics import quantiles

from benchmarks.command import WAYFARER
from benchmarks.figures import Figure
from wayfarer.daemon.socket.client import ask

TICKS_PER_S = os.sysconf("SC_CLK_TCK")
PERIOD_MS = 50.0
STARTS = 5


def figures(for_s: float) -> list[Figure]:
    """Measure several starts, and one drive of ``for_s`` seconds through a forest."""
    ready_s = [_time_to_ready() for _ in range(STARTS)]
    with tempfile.TemporaryDirectory() as folder, daemon(Path(folder)) as (process, _):
        path = Path(folder) / "control.sock"
        ask({"do": "arm", "heading_deg": 0.0}, path)
        cpu_before_s = _cpu_s(process.pid)
        time.sleep(for_s)
        cpu_percent = 100 * (_cpu_s(process.pid) - cpu_before_s) / for_s
        memory_mb = _memory_mb(process.pid)
        ask({"do": "stop"}, path)
        process.wait()
        late_ms = lateness_ms(tick_times_s(Path(folder)))
    percentiles = quantiles(late_ms, n=100)
    return [
        Figure("run --sim: ready after", "s", ready_s, 1.5),
        Figure("run --sim: CPU of one core at 20 Hz", "%", [cpu_percent], 10.0),
        Figure("run --sim: resident memory", "MB", [memory_mb], 80.0),
        Figure("run --sim: tick off its period, p50", "ms", [percentiles[49]]),
        Figure("run --sim: tick off its period, p99", "ms", [percentiles[98]]),
        Figure("run --sim: tick off its period, max", "ms", [max(late_ms)]),
    ]


@contextmanager
def daemon(folder: Path, *options: str) -> Iterator[tuple[subprocess.Popen[str], float]]:
    """Start a daemon in a folder, wait until it says that it is ready, and give it with the seconds that took."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notified:
        notified.bind(str(folder / "notify"))
        notified.settimeout(30.0)
        environment = {**os.environ, "NOTIFY_SOCKET": str(folder / "notify"), "RUNTIME_DIRECTORY": str(folder)}
        command = [str(WAYFARER), "run", "--sim", "--log-dir", str(folder / "logs"), *options]
        began_s = time.monotonic()
        process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        try:
            while b"READY=1" not in notified.recv(1000):
                pass
            yield process, time.monotonic() - began_s
        finally:
            process.kill()
            process.communicate()


def _time_to_ready() -> float:
    with tempfile.TemporaryDirectory() as folder, daemon(Path(folder)) as (_, ready_s):
        return ready_s


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def _memory_mb(pid: int) -> float:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    (resident,) = (line for line in lines if line.startswith("VmRSS"))
    return int(resident.split()[1]) / 1024


def tick_times_s(folder: Path) -> list[float]:
    """Return when each tick of a daemon's drive was, from its field log; the last line may be cut short."""
    (log,) = folder.glob("logs/*/run.00001.jsonl")
    lines = log.read_text(encoding="utf-8").rpartition("\n")[0].splitlines()
    return [record["t_s"] for record in map(json.loads, lines) if record["record"] == "tick"]


def lateness_ms(times_s: Sequence[float]) -> list[float]:
    """Return by how much each tick missed a period since the one before."""
    return [abs(1e3 * (after_s - before_s) - PERIOD_MS) for before_s, after_s in pairwise(times_s)]
