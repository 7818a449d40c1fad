"""A simulated day: one daemon's run at bus depth, with faults of the catalogue the whole time and its log on disk.

Nothing may grow: memory, tasks, open files, and the log beyond its cap. A person mends what lasts, arms again after
each fault, and carries the rover back when it is out of the forest. Bugs that end a run are left out: then another
process begins.

Memory is told in two ways: what the process takes of the computer, and how many blocks Python's own allocator has given
out. The second is exact, and costs nothing: tracing each allocation makes a day three times as long.
"""

from __future__ import annotations

import asyncio
import gc
import os
import sys
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from benchmarks.figures import print_table
from tests.faults.catalogue import catalogue
from wayfarer.commissioning.checks import HostEnvironment
from wayfarer.config.rover_file import LogSettings, RoverConfig, laid_over, load_rover
from wayfarer.control.modes import Mode
from wayfarer.control.run_log import Tee
from wayfarer.daemon.arming_check import running_inspection
from wayfarer.daemon.commands import RoverCommands
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.errors import NotArmed
from wayfarer.experiments.trial_setup import TrialSetup, TrialSpec
from wayfarer.fieldlog.log import FieldLog
from wayfarer.fieldlog.sink import Sink
from wayfarer.safety.permission import Asked
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.faults.kinds import Fault, misfit
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Depth
from wayfarer.simhal.world.world import World
from wayfarer.testing.safety_rules import SafetyRules

Beside = Callable[[TrialSetup], Coroutine[Any, Any, None]]

ROVER = "forestrover"
HOUR_S = 3600.0
DAY_S = 24 * HOUR_S
FAULT_EVERY_S = 20.0  # on average
LASTS_S = (0.05, 20.0)  # a fault that would last for ever is mended then
PERSON_EVERY_S = 10.0
SAMPLES = 24
LOG = LogSettings(part_mb=5.0, run_mb=20.0, free_mb=0.0)  # half an hour of ticks: the cap is reached soon
LOG_SLACK_MB = 0.1  # the last batch, and the headers
WARM_UP = 0.25  # share of the run in which caches fill, and the log
# How much more there may be in the second half after the warm-up than in the first. Blocks swing by 11,000 within each
# part of the log; one block kept a tick would be 650,000 in half a day.
MAY_GROW = {"rss_mb": 8.0, "blocks": 12_000.0, "tasks": 2.0, "handles": 1.0}
MB = 1_000_000.0


class Sample(NamedTuple):
    """How things were at one moment; counts are those of the whole run so far."""

    t_s: float
    rss_mb: float
    blocks: int
    tasks: int
    handles: int
    log_mb: float
    ticks: int
    faults: int
    missions: int


@dataclass
class Counts:
    """What has happened so far."""

    ticks: int = 0
    faults: int = 0
    missions: int = 0


class CountingRules(SafetyRules):
    """The safety rules, and how often there was a tick and a mission."""

    def __init__(self, counts: Counts) -> None:
        super().__init__()
        self._counts = counts

    def tick(self, record: Any) -> None:
        """Count a tick."""
        self._counts.ticks += 1
        super().tick(record)

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Count a mission."""
        self._counts.missions += name == "armed"
        super().event(name, t_s, **details)


def soak(for_s: float, beside: Beside | None = None, seed: int = 0) -> tuple[list[Sample], tuple[str, ...]]:
    """Run for so many simulated seconds; return samples and the safety rules that were broken.

    ``beside`` makes a coroutine that runs beside the rover, for tests of this soak itself.
    """
    with TemporaryDirectory() as folder, asyncio.Runner(loop_factory=VirtualLoop) as runner:
        return runner.run(_soak(for_s, seed, Path(folder), beside))


def growth(samples: Sequence[Sample]) -> list[str]:
    """Return what grew after the warm-up, in words, and whether the log ever passed its cap."""
    warm = [sample for sample in samples if sample.t_s >= WARM_UP * samples[-1].t_s]
    early, late = warm[: len(warm) // 2], warm[len(warm) // 2 :]
    found = [f"the log took {sample.log_mb:.1f} MB of {LOG.run_mb:g}" for sample in samples if _is_too_long(sample)][:1]
    for name, slack in MAY_GROW.items():
        before, after = (max(getattr(sample, name) for sample in part) for part in (early, late))
        if after > before + slack:
            found.append(f"{name} grew from {before:g} to {after:g}; {slack:g} more are allowed")
    return found


def print_soak(hours: float) -> int:
    """Soak, print the samples as a table and the verdict; return 1 if something grew or a rule was broken."""
    samples, broken = soak(hours * HOUR_S)
    header = ("hours", "RSS MB", "blocks", "tasks", "open files", "log MB", "ticks", "faults", "missions")
    print_table(header, [_cells(sample) for sample in samples])
    problems = [*growth(samples), *broken]
    print("\n" + ("\n".join(problems) if problems else "nothing grew, and no safety rule was broken"))
    return 1 if problems else 0


async def _soak(for_s: float, seed: int, folder: Path, beside: Beside | None) -> tuple[list[Sample], tuple[str, ...]]:
    config = load_rover(ROVER)
    limits = {"mission_time_s": DAY_S, "mission_distance_m": 1e6, "mission_radius_m": 1e6}
    config = laid_over(config, {"safety": {"start_delay_s": 0.5, **limits}})
    faults = _of_the_catalogue(config)
    forest, counts = generate_forest(seed, 0, seed), Counts()
    rules = CountingRules(counts)
    spec = TrialSpec(0, "forest-pledge", forest, seed, config, budget_m=inf, depth=Depth.BUS, faults=faults)
    logs = folder / "log"
    setup = TrialSetup(
        spec, lambda *_: Tee(FieldLog(Sink(logs, LOG), {"simulated": True}, wall=lambda t_s: t_s), rules)
    )
    setup.world.after_step = partial(carry_back, forest)  # in place of the outcome monitor, who would end the run
    rules.follow(setup)
    assert setup.injector is not None
    setup.injector.start(setup.world, setup.supervisor.inbox.put_power, [rules.note])
    rng = Random(seed)
    others = [_faults(setup, faults, rng, counts), _person(setup, rules, rng)]
    tasks = [asyncio.ensure_future(each) for each in (*others, *([beside(setup)] if beside else []))]
    run = asyncio.ensure_future(setup.supervisor.run())
    samples: list[Sample] = []
    for _ in range(SAMPLES):
        await asyncio.sleep(for_s / SAMPLES)
        samples.append(_sample(logs, counts))
        for task in (run, *tasks):
            if task.done():
                task.result()  # nothing here ends by itself: an error
    setup.supervisor.finish("requested", "the soak is over")
    await run
    for task in tasks:
        task.cancel()
    setup.injector.end()
    return samples, rules.broken


def carry_back(forest: Forest, world: World) -> None:
    """Put a rover that is out of the forest back to where it began."""
    if not (0.0 <= world.x_m <= WORLD_SIZE_M and 0.0 <= world.y_m < forest.goal_y_m):
        world.carry_to(*forest.start_m, forest.heading_deg)


def _of_the_catalogue(config: RoverConfig) -> tuple[Fault, ...]:
    """Return every fault of the catalogue that the rover can have, as one that never begins by itself.

    The rover is built for all of them, and ``_faults`` begins them. A bug that ends the run is left out.
    """
    faults = [fault for scenario in catalogue() for fault in scenario.faults]
    possible = [each for each in faults if each.kind != "task_crash" and not misfit(each, config, Depth.BUS)]
    return tuple({repr(fault): fault for fault in (replace(each, at_s=inf) for each in possible)}.values())


async def _faults(setup: TrialSetup, faults: Sequence[Fault], rng: Random, counts: Counts) -> None:
    """Begin a fault now and then, and none of a kind twice at the same part at the same time."""
    assert setup.injector is not None
    until_s: dict[tuple[str, str], float] = {}
    time = asyncio.get_running_loop().time
    while True:
        await asyncio.sleep(rng.expovariate(1.0 / FAULT_EVERY_S))
        fault = replace(rng.choice(faults), at_s=time(), for_s=rng.uniform(*LASTS_S))
        place = (fault.kind, fault.target)
        if until_s.get(place, 0.0) > time():
            continue
        counts.faults += 1
        until_s[place] = time() + fault.for_s + 1.0
        setup.injector.begin(counts.faults, fault)


async def _person(setup: TrialSetup, log: Any, rng: Random) -> None:
    """Arm again whatever stands, resume what is held, and now and then hold, disarm or send elsewhere."""
    config, nowhere = setup.config, Path()
    host = HostEnvironment(nowhere, nowhere, (), 0.0)
    inspect = partial(running_inspection, config, setup.rover, host, setup.supervisor)
    about = {"start_delay_s": config.safety.start_delay_s}
    commands = RoverCommands(setup.supervisor, setup.rover.motors, inspect, log, about, checks=())
    controller = setup.supervisor.controller
    while True:
        await asyncio.sleep(rng.expovariate(1.0 / PERSON_EVERY_S))
        asked = Asked(asyncio.get_running_loop().time())
        with suppress(RequestRefused, NotArmed):
            if controller.mode is Mode.DISARMED:
                await commands.arm(asked)
            elif controller.held:
                await commands.resume(asked)
            elif rng.random() < 0.1:
                await rng.choice((commands.hold, commands.disarm, partial(commands.goal, rng.uniform(0.0, 359.0))))()


def _sample(logs: Path, counts: Counts) -> Sample:
    gc.collect()
    return Sample(
        asyncio.get_running_loop().time(),
        resident_mb(),
        sys.getallocatedblocks(),
        len(asyncio.all_tasks()),
        open_files(),
        sum(path.stat().st_size for path in logs.iterdir()) / MB,
        counts.ticks,
        counts.faults,
        counts.missions,
    )


def resident_mb() -> float:
    """Return how much of the computer's memory this process has, in MB."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / MB


def open_files() -> int:
    """Return how many files, sockets and pipes this process has open."""
    return len(os.listdir("/proc/self/fd"))  # noqa: PTH208 - of links that may be gone


def _is_too_long(sample: Sample) -> bool:
    return sample.log_mb > LOG.run_mb + LOG_SLACK_MB


def _cells(sample: Sample) -> tuple[str, ...]:
    t_s, rss_mb, blocks, tasks, handles, log_mb, *counted = sample
    shown: Iterator[str] = map(str, (blocks, tasks, handles))
    return f"{t_s / HOUR_S:.2f}", f"{rss_mb:.1f}", *shown, f"{log_mb:.1f}", *map(str, counted)
