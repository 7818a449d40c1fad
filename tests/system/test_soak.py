"""Twenty simulated minutes of faults leave nothing behind; and what does grow is found.

A simulated day is ``python -m benchmarks soak``.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from io import TextIOWrapper
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from benchmarks.soak import Beside, growth, soak
from wayfarer.experiments.trial_setup import TrialSetup

MINUTES_S = 20 * 60.0
SHORT_S = 5 * 60.0


@pytest.mark.long
def test_twenty_minutes_of_faults_leave_nothing_behind() -> None:
    samples, broken = soak(MINUTES_S)
    assert growth(samples) == []
    assert broken == ()
    assert samples[-1].faults > 30
    assert samples[-1].missions > 5
    assert samples[-1].ticks == pytest.approx(MINUTES_S * 20.0, rel=0.1)


def each_second(leak: Callable[[int], Iterable[Any]], undo: Callable[[Any], object]) -> Beside:
    """Something that goes wrong in the daemon, a little each second; it is undone when the soak is over."""

    async def leaks(_: TrialSetup) -> None:
        leaked: list[Any] = []
        try:
            for second in count():
                await asyncio.sleep(1.0)
                leaked.extend(leak(second))
        finally:
            for each in leaked:
                undo(each)

    return leaks


async def waits_for_ever() -> None:
    await asyncio.sleep(1e9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("what", "leaks"),
    [
        ("blocks", each_second(lambda second: (bytes(second % 64 + 1) for _ in range(200)), len)),
        ("tasks", each_second(lambda _: [asyncio.ensure_future(waits_for_ever())], asyncio.Task.cancel)),
        ("handles", each_second(lambda _: [Path("/dev/null").open()], TextIOWrapper.close)),  # noqa: SIM115 - the leak
    ],
)
def test_leak_that_was_planted_is_found(what: str, leaks: Beside) -> None:
    samples, _ = soak(SHORT_S, leaks)
    assert [text.split()[0] for text in growth(samples) if not text.startswith("rss")] == [what]
