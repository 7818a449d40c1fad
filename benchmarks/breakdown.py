"""Where the time of a control tick goes: trials are interrupted now and then, and asked whose code runs.

A sample counts for the innermost frame that belongs to a part. Time in C (asyncio's tasks, numpy) counts for the part
that runs when it returns. The profiling clock ticks in CPU time, so that a loaded machine does not shift the shares.
"""

from __future__ import annotations

import signal
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from time import process_time
from types import FrameType

from benchmarks.figures import print_table
from benchmarks.stack import spec_of
from wayfarer.experiments.trial import run_trial

INTERVAL_S = 0.001
OTHER = "other (tally, set-up of the trial)"

# What a file's path contains, and the part that it belongs to.
PARTS = {
    "/asyncio/": "event loop",
    "/wayfarer/simhal/clock/virtual_loop.py": "event loop",
    "/wayfarer/control/rate.py": "event loop",
    "/wayfarer/simhal/world/world.py": "world",
    "/wayfarer/simhal/world/collision.py": "world",
    "/wayfarer/simhal/random_streams.py": "world",
    "/wayfarer/experiments/outcome.py": "world",
    "/wayfarer/simhal/parts.py": "sensors and motors",
    "/wayfarer/control/supervisor.py": "sensors and motors",
    "/wayfarer/control/tick.py": "sensors and motors",
    "/wayfarer/detector/": "detector",
    "/wayfarer/escape/": "escape handler",
    "/wayfarer/safety/gate.py": "safety gate",
    "/wayfarer/control/controller.py": "controller",
}


def part_of(frame: FrameType | None) -> str:
    """Return the part whose code runs in a frame, or called it."""
    while frame is not None:
        path = frame.f_code.co_filename
        for place, part in PARTS.items():
            if place in path:
                return part
        frame = frame.f_back
    return OTHER


@contextmanager
def sampled() -> Iterator[Counter[str]]:
    """Count samples by part while the body runs."""
    samples: Counter[str] = Counter()

    def sample(_number: int, frame: FrameType | None) -> None:
        samples[part_of(frame)] += 1

    before = signal.signal(signal.SIGPROF, sample)
    signal.setitimer(signal.ITIMER_PROF, INTERVAL_S, INTERVAL_S)
    try:
        yield samples
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def print_breakdown(trials: int) -> None:
    """Print how a control tick's CPU is shared out; its sum was measured without the samples' own cost."""
    specs = [spec_of(trial) for trial in range(trials)]
    before_s = process_time()
    ticks = sum(run_trial(spec).ticks for spec in specs)
    us_per_tick = 1e6 * (process_time() - before_s) / ticks
    with sampled() as samples:
        for spec in specs:
            run_trial(spec)
    total = samples.total()
    rows = [
        (part, f"{100 * count / total:.1f} %", f"{us_per_tick * count / total:.1f}")
        for part, count in samples.most_common()
    ]
    print(f"{trials} forest-pledge trials, {ticks} control ticks, {total} samples\n")
    print_table(("part", "share", "µs a tick"), [*rows, ("all", "100 %", f"{us_per_tick:.1f}")])
