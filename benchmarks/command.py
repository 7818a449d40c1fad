"""The ``wayfarer`` command as its user meets it: whole processes, from start-up to exit."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from time import perf_counter
from typing import NamedTuple

from benchmarks.figures import Figure, timed

WAYFARER = Path(sys.executable).with_name("wayfarer")
MOST_S, MOST_TRIALS = 10.0, 1000  # on two idle cores; chosen by us


class Campaign(NamedTuple):
    """What one campaign took."""

    wall_s: float
    cpu_us_per_tick: float
    largest_process_mb: float


def run_campaign(trials: int) -> Campaign:
    """Run ``wayfarer sim`` with a process for each core that this one may use."""
    cores = len(os.sched_getaffinity(0))
    with TemporaryDirectory() as folder, TemporaryFile() as told:
        out = Path(folder) / "out"
        before_s = perf_counter()
        process = subprocess.Popen(
            [WAYFARER, "sim", "--trials", str(trials), "--jobs", str(cores), "--out", out, "--json"],
            stdout=told,
            stderr=subprocess.DEVNULL,
        )
        _, status, used = os.wait4(process.pid, 0)
        wall_s = perf_counter() - before_s
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            raise SystemExit(f"wayfarer sim ended with exit code {process.returncode}; run it by hand to see why")
        told.seek(0)
        last_run = json.load(told)["last_run"]
    return Campaign(wall_s, 1e6 * last_run["cpu_s"] / last_run["ticks"], used.ru_maxrss / 1024)


def campaigns(trials: int, runs: int) -> list[Figure]:
    """Measure ``wayfarer sim --trials N``: time, CPU per tick, memory of its largest process."""
    ran = [run_campaign(trials) for _ in range(runs)]
    limit_s = MOST_S if trials == MOST_TRIALS else None
    return [
        Figure(f"{trials} forest-pledge trials, whole command", "s", [run.wall_s for run in ran], limit_s),
        Figure(
            "CPU per control tick, whole command, start-up included",
            "µs",
            [run.cpu_us_per_tick for run in ran],
            40.0 if limit_s else None,  # start-up is shared out over few ticks in a short campaign
        ),
        Figure("memory of the largest process", "MB", [run.largest_process_mb for run in ran], 200.0),
    ]


def version(runs: int) -> Figure:
    """Measure ``wayfarer --version``."""

    def run() -> None:
        subprocess.run([WAYFARER, "--version"], check=True, stdout=subprocess.DEVNULL)

    run()  # the first one may still have to write bytecode
    return Figure("wayfarer --version", "s", [timed(perf_counter, run) for _ in range(runs)], 0.25)
