"""The real drivers: what bus depth costs, and how long the event loop is blocked while a bus hangs."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from random import Random
from time import process_time

from benchmarks.figures import Figure
from benchmarks.stack import spec_of
from wayfarer.config.factory import assemble
from wayfarer.config.rover_file import load_rover
from wayfarer.control.supervisor import Supervisor
from wayfarer.drivers.threaded import ThreadedI2C
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.experiments.outcome import TrialCounters
from wayfarer.experiments.trial import run_trial
from wayfarer.safety.permission import Asked
from wayfarer.simhal.buses import FakeBuses, FakeI2C
from wayfarer.simhal.chip_wiring import ChipWiring
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Depth, Physics
from wayfarer.simhal.world.world import World

HANG_S = 1.0
HEARTBEAT_S = 0.001


def depths(trials: int) -> list[Figure]:
    """Measure the same trials at both depths, in turn, so that both meet the same noise of the machine."""
    times_us: dict[Depth, list[float]] = {depth: [] for depth in Depth}
    for trial in range(trials):
        for depth in Depth:
            before_s = process_time()
            ticks = run_trial(replace(spec_of(trial), depth=depth)).ticks
            times_us[depth].append(1e6 * (process_time() - before_s) / ticks)
    return [Figure(f"CPU per control tick at {depth.value} depth", "µs", times_us[depth]) for depth in Depth]


def hanging_bus(runs: int) -> list[Figure]:
    """Measure a rover on one I2C bus that hangs for a second while it drives."""
    seen = [asyncio.run(_drive_into_a_hang()) for _ in range(runs)]
    return [
        Figure("longest stop of the event loop before the bus hangs", "ms", [before_ms for before_ms, _, _ in seen]),
        Figure(
            "longest stop of the event loop while a bus hangs for 1 s", "ms", [gap_ms for _, gap_ms, _ in seen], 20.0
        ),
        Figure("wheels stopped after the last command, by the board itself", "ms", [ms for _, _, ms in seen], 260.0),
    ]


async def _drive_into_a_hang() -> tuple[float, float, float]:
    """Return the loop's longest stop before and during the hang, and how long the wheels went on; milliseconds."""
    loop = asyncio.get_running_loop()
    rover = load_rover("minirover")
    flow = {"driver": "pmw3901", "bus": "/dev/spidev0.1"}
    parts = {**{name: rover.parts[name] for name in ("compass", "motors")}, "motion": flow}
    safety = replace(rover.safety, start_delay_s=0.0)
    config = rover.model_copy(update={"parts": parts, "safety": safety})
    chips = FakeBuses()
    device = HangingDevice(chips.i2c("/dev/i2c-1"))
    buses = HangingBuses(chips, device)
    world = World(generate_forest(0, 0, 0), config.vehicle, Physics(), RandomStreams(0), starts_s=loop.time())
    wiring = ChipWiring(world, RandomStreams(0), loop.time, chips)
    for part, table in config.parts.items():
        wiring.attach(part, table)
    algorithm = CATALOGUE["forest-pledge"]
    handler = algorithm.make(config.escape, config.vehicle, Random(0))
    supervisor = Supervisor(assemble(config, buses), config, algorithm, handler, TrialCounters(), ladder_seed=1)
    running = asyncio.create_task(supervisor.run())
    await asyncio.sleep(1.0)
    await supervisor.arm(Asked(asyncio.get_running_loop().time()), 0.0)
    before_s = await _longest_stop_s(partial(asyncio.sleep, 1.0))
    device.hang_s = HANG_S
    stopped_s = 0.0

    async def watch() -> None:
        nonlocal stopped_s
        for _ in range(round(HANG_S / 0.005)):
            await asyncio.sleep(0.005)
            wiring.tick()
            if world.commanded == (0.0, 0.0) and not stopped_s:
                stopped_s = loop.time() - device.last_write_s

    during_s = await _longest_stop_s(watch)
    supervisor.finish("requested", "measured")
    with suppress(Exception):
        await running
    await buses.close()
    return 1e3 * before_s, 1e3 * during_s, 1e3 * stopped_s


async def _longest_stop_s(work: Callable[[], Awaitable[None]]) -> float:
    """Return the longest time between two turns of the loop while some work goes on, beyond what was asked for."""
    loop = asyncio.get_running_loop()
    longest_s, working = 0.0, asyncio.ensure_future(work())
    while not working.done():
        before_s = loop.time()
        await asyncio.sleep(HEARTBEAT_S)
        longest_s = max(longest_s, loop.time() - before_s - HEARTBEAT_S)
    return longest_s


class HangingDevice:
    """A blocking I2C bus over chips, which hangs for ``hang_s`` at the next transfer that finds it set."""

    def __init__(self, chips: FakeI2C) -> None:
        self._chips = chips
        self.hang_s = 0.0
        self.last_write_s = 0.0

    def write(self, address: int, data: bytes) -> None:
        """Write, late if it hangs."""
        self._hang()
        self._chips.post(address, data)
        if self.hang_s == 0.0 and data[0] in range(8, 13):  # the ThunderBorg's motors
            self.last_write_s = time.monotonic()

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        """Write and read, late if it hangs."""
        self._hang()
        chip = self._chips.chip_at(address)
        chip.write(data)
        return chip.read(count)

    write_then_read = write_read

    def close(self) -> None:
        """Nothing to close."""

    def _hang(self) -> None:
        hang_s, self.hang_s = self.hang_s, 0.0
        time.sleep(hang_s)


class HangingBuses(FakeBuses):
    """Buses whose I2C blocks, behind the rover's own worker thread; the others are simulated as usual."""

    def __init__(self, chips: FakeBuses, device: HangingDevice) -> None:
        super().__init__()
        self.spi = chips.spi  # type: ignore[method-assign]
        self._threaded = ThreadedI2C("/dev/i2c-1", lambda: device)

    def i2c(self, name: str) -> ThreadedI2C:  # type: ignore[override]  # noqa: ARG002
        """Return the bus that blocks."""
        return self._threaded

    async def close(self, wait_s: float = 0.2) -> None:  # noqa: ARG002
        """Release the bus."""
        await self._threaded.close()
