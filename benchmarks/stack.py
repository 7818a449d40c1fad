"""The stack in one process: control ticks, the set-up of a trial, wake-ups of the event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from time import process_time

from benchmarks.figures import Figure, timed
from benchmarks.stock_loop import JumpingStockLoop
from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.trial import run_trial
from wayfarer.experiments.trial_setup import TrialSpec
from wayfarer.simhal.clock.virtual_loop import VirtualLoop

ALGORITHM = "forest-pledge"
CAMPAIGN = Campaign((ALGORITHM,), 1000, load_rover("sim"))
SLEEPERS, SLEEPS = 3, 10_000  # as a control tick whose compass, motion sensor and motors wait


def spec_of(trial: int) -> TrialSpec:
    """Return a trial of the campaign that ``wayfarer sim`` runs."""
    return CAMPAIGN.spec(Task(ALGORITHM, trial), CAMPAIGN.make_forest(trial))


def cpu_us_per_tick(spec: TrialSpec) -> float:
    """Run a trial; return its CPU microseconds a control tick, its own set-up included."""
    before_s = process_time()
    ticks = run_trial(spec).ticks
    return 1e6 * (process_time() - before_s) / ticks


def ticks(trials: int) -> Figure:
    """Measure whole trials without the pool."""
    specs = [spec_of(trial) for trial in range(trials)]
    run_trial(specs[0])
    return Figure("CPU per control tick, one process", "µs", [cpu_us_per_tick(spec) for spec in specs], 40.0)


def set_up(trials: int) -> list[Figure]:
    """Measure the drawing of forests, and trials that end with their first step: all that is not driving."""
    drawn_ms = [1e3 * timed(process_time, CAMPAIGN.make_forest, trial) for trial in range(trials)]
    specs = [replace(spec_of(trial), budget_m=1e-9) for trial in range(trials)]
    built_ms = [1e3 * timed(process_time, run_trial, spec) for spec in specs]
    return [
        Figure("set-up of a trial: world, supervisor, loop", "ms", built_ms, 5.0),
        Figure("drawing a forest", "ms", drawn_ms),
    ]


def wake_ups(runs: int) -> list[Figure]:
    """Measure a wake-up from ``asyncio.sleep`` on both loops."""
    loops = {"VirtualLoop": VirtualLoop, "the stock loop, its clock patched": JumpingStockLoop}
    return [
        Figure(f"wake-up on {name}", "µs", [_wake_up_us(loop) for _ in range(runs)]) for name, loop in loops.items()
    ]


def _wake_up_us(loop_factory: Callable[[], asyncio.AbstractEventLoop]) -> float:
    async def sleep_on() -> None:
        for _ in range(SLEEPS):
            await asyncio.sleep(0.05)

    async def main() -> None:
        async with asyncio.TaskGroup() as group:
            for _ in range(SLEEPERS):
                group.create_task(sleep_on())

    with asyncio.Runner(loop_factory=loop_factory) as runner:
        return 1e6 * timed(process_time, runner.run, main()) / (SLEEPERS * SLEEPS)
