"""Faults of the process that are possible in virtual time: a blocked event loop, a sagging supply."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from math import ceil

from wayfarer.daemon.host_health import POWER_EVERY_S
from wayfarer.simhal.clock.virtual_loop import VirtualLoop
from wayfarer.simhal.faults.kinds import Fault, LoopStall, Undervoltage

UNDER_VOLTAGE = 0x1  # of the Raspberry Pi's get_throttled: bit 0 is now, bit 16 since boot (field.md 4)
UNDER_VOLTAGE_SINCE_BOOT = 0x10000

TakePower = Callable[[float, int], None]


def process_fault(fault: Fault, take_power: TakePower) -> AbstractContextManager[None]:
    """Return what makes a fault of this layer happen; ``take_power`` takes the computer's flags at a time."""
    if isinstance(fault.params, LoopStall):
        return _loop_stall(fault.params)
    assert isinstance(fault.params, Undervoltage)
    return _undervoltage(fault.params, take_power)


@contextmanager
def _loop_stall(params: LoopStall) -> Iterator[None]:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    loop.stall(params.by_s)
    yield


@contextmanager
def _undervoltage(params: Undervoltage, take_power: TakePower) -> Iterator[None]:
    """Have the flags go up and down, as a daemon sees them that looks once in a while."""
    loop = asyncio.get_running_loop()
    timers = []
    for dip in range(params.times):
        at_s = ceil((loop.time() + dip * params.every_s) / POWER_EVERY_S) * POWER_EVERY_S
        timers.append(loop.call_at(at_s, lambda: take_power(loop.time(), UNDER_VOLTAGE | UNDER_VOLTAGE_SINCE_BOOT)))
        over_s = at_s + params.every_s / 2
        timers.append(loop.call_at(over_s, lambda: take_power(loop.time(), UNDER_VOLTAGE_SINCE_BOOT)))
    yield
    for timer in timers:
        timer.cancel()
    take_power(loop.time(), UNDER_VOLTAGE_SINCE_BOOT)
