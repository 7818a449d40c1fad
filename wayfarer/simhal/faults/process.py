"""Faults of the process that are possible in virtual time: a blocked event loop, a sagging supply."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import ceil
from random import Random

from wayfarer.daemon.host_health import POWER_EVERY_S
from wayfarer.safety.supply import UNDER_VOLTAGE_NOW, UNDER_VOLTAGE_SINCE_BOOT
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.faults.kinds import LoopStall, Undervoltage
from wayfarer.simhal.faults.scoped import Effect

# Takes the computer's flags at a time: the target of these faults.
TakePower = Callable[[float, int], None]


@contextmanager
def _loop_stall(_: TakePower, params: LoopStall, __: Random) -> Iterator[None]:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    loop.stall(params.by_s)
    yield


@contextmanager
def _undervoltage(take_power: TakePower, params: Undervoltage, _: Random) -> Iterator[None]:
    """Have the flags go up and down, as a daemon sees them that looks once in a while."""
    loop = asyncio.get_running_loop()
    timers = []
    for dip in range(params.times):
        at_s = ceil((loop.time() + dip * params.every_s) / POWER_EVERY_S) * POWER_EVERY_S
        timers.append(loop.call_at(at_s, lambda: take_power(loop.time(), UNDER_VOLTAGE_NOW | UNDER_VOLTAGE_SINCE_BOOT)))
        over_s = at_s + params.every_s / 2
        timers.append(loop.call_at(over_s, lambda: take_power(loop.time(), UNDER_VOLTAGE_SINCE_BOOT)))
    yield
    for timer in timers:
        timer.cancel()
    take_power(loop.time(), UNDER_VOLTAGE_SINCE_BOOT)


EFFECTS: Mapping[str, Effect] = {"loop_stall": _loop_stall, "undervoltage": _undervoltage}
