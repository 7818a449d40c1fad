"""The time of drivers on simulated chips, and a process that is suspended."""

from __future__ import annotations

import asyncio

from wayfarer.simhal.clock.virtual_loop import VirtualLoop


def now_s() -> float:
    """The time on the loop, and zero before it runs: a fixture makes its chips before that."""
    try:
        return asyncio.get_running_loop().time()
    except RuntimeError:
        return 0.0


def stall(for_s: float) -> None:
    """Let time pass without the loop, as in a process that is suspended."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    loop.stall(for_s)
