"""The field log: how evenly a loop ticks whatever the disk does, and what writing and reading a record costs."""

from __future__ import annotations

import asyncio
import resource
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from itertools import pairwise
from pathlib import Path
from statistics import quantiles

from benchmarks.figures import Figure, timed
from wayfarer.control.tick import TickRecord
from wayfarer.escape.api import Decision, Observation, Phase
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import Tick
from wayfarer.fieldlog.sink import Sink
from wayfarer.hal import CompassReading, MotionReading, WheelCommand

PERIOD_S = 0.01  # five times the rover's rate, to meet five times as many moments of the disk
STALL_S = 0.5  # SD cards stall for up to as long (docs/reference/hardware.md)
HOUR = 72_000  # ticks at 20 Hz


@contextmanager
def _full(_: Path, log: Sink) -> Iterator[None]:
    """Have the operating system refuse whatever is beyond the header."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1, hard))
    yield
    log.close()
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextmanager
def _stalling(_: Path, log: Sink) -> Iterator[None]:
    """Have each sync take half a second."""
    sync = log._parts.sync

    def late() -> None:
        time.sleep(STALL_S)
        sync()

    log._parts.sync = late  # type: ignore[method-assign]
    yield


@contextmanager
def _deleted(folder: Path, log: Sink) -> Iterator[None]:
    """Delete the folder before each sync, so each second."""
    sync = log._parts.sync

    def gone() -> None:
        shutil.rmtree(folder, ignore_errors=True)
        sync()

    log._parts.sync = gone  # type: ignore[method-assign]
    yield


DISKS: dict[str, Callable[[Path, Sink], AbstractContextManager[None]] | None] = {
    "no log": None,
    "log on a healthy disk": lambda *_: nullcontext(),
    "log on a full disk": _full,
    "log on a disk that stalls": _stalling,
    "log in a folder that is deleted": _deleted,
}


def jitter(runs: int, for_s: float) -> list[Figure]:
    """Measure a loop that ticks and logs on several disks, in turn, so that all meet the same noise of the machine."""
    seen: dict[str, list[tuple[float, float, float]]] = {disk: [] for disk in DISKS}
    for _ in range(runs):
        for disk, kind in DISKS.items():
            with tempfile.TemporaryDirectory() as folder:
                run = Path(folder) / "run"
                sink = Sink(run, clock=time.monotonic)
                log = kind and FieldLog(sink, {})
                with kind(run, sink) if kind else nullcontext():
                    late_ms = asyncio.run(_tick(log, for_s))
                if log is not None:
                    log.close("requested", "measured")
            percentiles = quantiles(late_ms, n=100)
            seen[disk].append((percentiles[49], percentiles[98], max(late_ms)))
    return [
        Figure(f"100 Hz tick off its period, {disk}, {kind}", "ms", [run[index] for run in seen[disk]])
        for disk in DISKS
        for index, kind in enumerate(("p50", "p99", "max"))
    ]


def costs(runs: int) -> list[Figure]:
    """Measure what a tick's record costs the event loop, what it takes on the disk, and reading an hour of them."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / str(run) for run in range(runs)]
        written_us = [_write_hour(path) for path in paths]
        mb = [(path / "run.00001.jsonl").stat().st_size / 1e6 for path in paths]
        read_s = [timed(time.perf_counter, _read, path) for path in paths]
    return [
        Figure("log: CPU of the event loop's thread a tick", "µs", written_us),
        Figure("log: an hour of ticks at 20 Hz", "MB", mb),
        Figure("log: reading that hour", "s", read_s, 5.0),
    ]


async def _tick(log: FieldLog | None, for_s: float) -> list[float]:
    """Return by how much each tick missed a period since the one before, milliseconds."""
    loop = asyncio.get_running_loop()
    began_s, times_s = loop.time(), list[float]()
    for number in range(1, round(for_s / PERIOD_S) + 1):
        await asyncio.sleep(began_s + number * PERIOD_S - loop.time())
        times_s.append(loop.time())
        if log is not None:
            log.tick(_record(loop.time()))
    return [1e3 * abs(after_s - before_s - PERIOD_S) for before_s, after_s in pairwise(times_s)]


def _write_hour(run: Path) -> float:
    """Return the microseconds of CPU that a record takes on the thread that makes it."""
    log = FieldLog(Sink(run, clock=time.monotonic, queue_bytes=100_000_000), {})
    records = [_record(number / 20) for number in range(HOUR)]
    before_s = time.thread_time()
    for record in records:
        log.tick(record)
    took_s = time.thread_time() - before_s
    log.close("requested", "measured")
    return 1e6 * took_s / HOUR


def _read(run: Path) -> int:
    return sum(isinstance(record, Tick) for record in RunReader(run))


def _record(t_s: float) -> TickRecord:
    """Return a tick as a driving rover has it."""
    compass = CompassReading(t_s, 359.7, -0.5, -1.6, 3)
    motion = MotionReading(t_s, 0.09337941000000001, 0.000213195, 0.8)
    wheels = WheelCommand(0.7165074511489262, 0.7120443949188263)
    observation = Observation(t_s, 359.7, -0.5, -1.6, (), None, 0.0, 1.6667716735433081)
    memory = {"counter_deg": -0.2, "side": 1, "turn_deg": 0.0, "episodes": 0, "blocked_turns": 0}
    decision = Decision(wheels, Phase.FOLLOW, "follow")
    record = TickRecord(t_s)
    record.compass, record.motion, record.observation = compass, motion, observation
    record.decision, record.applied = decision, wheels
    record.memory = lambda: memory
    return record
