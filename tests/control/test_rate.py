"""How a task is paced, and how often somebody may ask for something."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from benchmarks.stock_loop import JumpingStockLoop
from tests.virtual import virtual
from wayfarer.control.rate import Rate, RateLimiter, without_waiting


@virtual
async def test_period_that_was_missed_is_skipped_and_the_grid_begins_again() -> None:
    loop, rate, woke_s = asyncio.get_running_loop(), Rate(8.0), []
    begun_s = loop.time()
    for busy_s in (0.0, 0.1, 0.3, 0.0, 0.1):
        await asyncio.sleep(busy_s)
        await rate.wait()
        woke_s.append(loop.time() - begun_s)
    assert woke_s == pytest.approx([0.125, 0.25, 0.55, 0.675, 0.8])


class OthersLoop(JumpingStockLoop):
    clock = object()


def test_clock_that_a_loop_of_others_has_is_not_taken_for_ours() -> None:
    async def wait() -> float:
        loop = asyncio.get_running_loop()
        begun_s = loop.time()
        await Rate(8.0).wait()
        return loop.time() - begun_s

    with asyncio.Runner(loop_factory=OthersLoop) as runner:
        assert runner.run(wait()) == pytest.approx(0.125)


class Part:
    async def read(self) -> str:
        return self.read_without_waiting(0.0)

    def read_without_waiting(self, t_s: float) -> str:
        return f"read at {t_s}"


class Noisy(Part):
    async def read(self) -> str:
        return f"{await super().read()}, with noise"


class Named(Part):
    name = "named"


class Wrapper:
    def __init__(self, part: Part) -> None:
        self._part = part

    def __getattr__(self, name: str) -> Any:
        return getattr(self._part, name)

    async def read(self) -> str:
        return f"{await self._part.read()}, changed"


@pytest.mark.parametrize("part", [Noisy(), Wrapper(Part()), object()], ids=["other read", "wrapped", "no read"])
def test_part_whose_read_may_do_more_is_not_read_at_once(part: object) -> None:
    assert without_waiting(part, "read") is None


@pytest.mark.parametrize("part", [Part(), Named()])
def test_part_that_never_waits_is_read_at_once(part: object) -> None:
    read = without_waiting(part, "read")
    assert read is not None
    assert read(2.0) == "read at 2.0"


def test_allowance_is_used_up_and_comes_back() -> None:
    """Five at once, two a second."""
    allowance = RateLimiter()
    assert [allowance.take(10.0) for _ in range(6)] == [True] * 5 + [False]
    assert [allowance.take(11.0) for _ in range(3)] == [True, True, False]
    assert [allowance.take(100.0) for _ in range(6)] == [True] * 5 + [False], "never more than at first"
