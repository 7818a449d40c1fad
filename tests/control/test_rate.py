"""How a task is paced, and how often somebody may ask for something."""

from __future__ import annotations

import asyncio

import pytest

from tests.virtual import virtual
from wayfarer.control.rate import Rate, RateLimiter


@virtual
async def test_period_that_was_missed_is_skipped_and_the_grid_begins_again() -> None:
    loop, rate, woke_s = asyncio.get_running_loop(), Rate(8.0), []
    begun_s = loop.time()
    for busy_s in (0.0, 0.1, 0.3, 0.0, 0.1):
        await asyncio.sleep(busy_s)
        await rate.wait()
        woke_s.append(loop.time() - begun_s)
    assert woke_s == pytest.approx([0.125, 0.25, 0.55, 0.675, 0.8])


def test_allowance_is_used_up_and_comes_back() -> None:
    """Five at once, two a second."""
    allowance = RateLimiter()
    assert [allowance.take(10.0) for _ in range(6)] == [True] * 5 + [False]
    assert [allowance.take(11.0) for _ in range(3)] == [True, True, False]
    assert [allowance.take(100.0) for _ in range(6)] == [True] * 5 + [False], "never more than at first"
