"""Faults of the process that are possible in virtual time: a blocked event loop, a sagging supply.

``tests/system`` injects into a real daemon what needs a real process: a full disk, a signal.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import ceil
from random import Random
from typing import Annotated, ClassVar

from annotated_types import Interval

from wayfarer.daemon.storage import POWER_EVERY_S
from wayfarer.safety.power import UNDER_VOLTAGE_NOW, UNDER_VOLTAGE_SINCE_BOOT
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.faults.fault_kind import PARTS, FaultKind
from wayfarer.simhal.faults.readings import Bug, FaultyPart

# Takes the computer's flags at a time: the target of these faults.
TakePower = Callable[[float, int], None]
PROCESS = "process"  # in virtual time only: the clock and the power of a daemon are real


class ProcessFault(FaultKind):
    """Happens to the daemon, or to the computer under it."""

    targets: ClassVar[tuple[str, ...]] = (PROCESS,)


class TaskCrash(ProcessFault):
    """A bug in a driver ends its task."""

    targets = PARTS

    @contextmanager
    def effect(self, part: FaultyPart, _: Random) -> Iterator[None]:
        part.crash = Bug("a bug in a driver, injected")
        yield
        part.crash = None


@dataclass(frozen=True)
class LoopStall(ProcessFault):
    """Something blocks the event loop; or the clock jumps, which looks the same."""

    by_s: Annotated[float, Interval(gt=0, le=3600)] = 0.5

    @contextmanager
    def effect(self, _: TakePower, __: Random) -> Iterator[None]:
        """Block it once; the fault may last longer."""
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        loop.stall(self.by_s)
        yield


@dataclass(frozen=True)
class Undervoltage(ProcessFault):
    """The computer's supply sags ``times``, each half of ``every_s`` long."""

    times: Annotated[int, Interval(ge=1, le=1000)] = 1
    every_s: Annotated[float, Interval(ge=2, le=3600)] = 10.0

    @contextmanager
    def effect(self, take_power: TakePower, _: Random) -> Iterator[None]:
        """Have the flags go up and down, as a daemon sees them that looks once in a while."""
        loop = asyncio.get_running_loop()
        sags, over = UNDER_VOLTAGE_NOW | UNDER_VOLTAGE_SINCE_BOOT, UNDER_VOLTAGE_SINCE_BOOT
        timers = []
        for dip in range(self.times):
            at_s = ceil((loop.time() + dip * self.every_s) / POWER_EVERY_S) * POWER_EVERY_S
            timers.append(loop.call_at(at_s, lambda: take_power(loop.time(), sags)))
            timers.append(loop.call_at(at_s + self.every_s / 2, lambda: take_power(loop.time(), over)))
        yield
        for timer in timers:
            timer.cancel()
        take_power(loop.time(), over)
