"""What viewers of the live page cost the control tick: a daemon that drives, with none and with ten, in turn.

``python -m benchmarks.viewers`` prints the figures; three minutes.
"""

from __future__ import annotations

import asyncio
import json
import re
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from statistics import quantiles

from aiohttp import ClientSession, ClientWebSocketResponse

from benchmarks.daemon import daemon, lateness_ms, tick_times_s
from benchmarks.figures import HEADER, Figure, print_table
from wayfarer.daemon.socket.client import ask

VIEWERS = 10
SETTLE_S = 1.0  # ten snapshots are not steady state

Spell = tuple[float, float]  # from and to, on CLOCK_BOOTTIME, the daemon's


def figures(runs: int, for_s: float) -> list[Figure]:
    """Drive ``runs`` times; each drive has two spells of ``for_s`` seconds with viewers and two without."""
    alone: list[list[float]] = []
    watched: list[list[float]] = []
    for _ in range(runs):
        with tempfile.TemporaryDirectory(prefix="wf-") as folder:
            spells = _drive(Path(folder), for_s)
            times_s = tick_times_s(Path(folder))
        for spell, (begins_s, ends_s) in enumerate(spells):
            late_ms = lateness_ms([time_s for time_s in times_s if begins_s <= time_s <= ends_s])
            (watched if spell % 2 else alone).append(quantiles(late_ms, n=100))
    more_ms = [with_ms[98] - without_ms[98] for without_ms, with_ms in zip(alone, watched, strict=True)]
    return [
        Figure("tick off its period, p50, no viewer", "ms", [each[49] for each in alone]),
        Figure(f"tick off its period, p50, {VIEWERS} viewers", "ms", [each[49] for each in watched]),
        Figure("tick off its period, p99, no viewer", "ms", [each[98] for each in alone]),
        Figure(f"tick off its period, p99, {VIEWERS} viewers", "ms", [each[98] for each in watched]),
        Figure(f"p99 with {VIEWERS} viewers more than in the spell before", "ms", more_ms, 2.0),
    ]


def _drive(folder: Path, for_s: float) -> list[Spell]:
    """Drive through a forest and return the spells, the first of them and every second without viewers."""
    with daemon(folder, "--live", "--live-port", "0") as (process, _):
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None
        ask({"do": "arm", "heading_deg": 0.0}, folder / "control.sock", timeout_s=10.0)
        return asyncio.run(_alternate(found.group(), for_s))


async def _alternate(url: str, for_s: float) -> list[Spell]:
    spells = []
    for spell in range(4):
        async with _viewers(url, VIEWERS if spell % 2 else 0):
            await asyncio.sleep(SETTLE_S)
            begins_s = time.clock_gettime(time.CLOCK_BOOTTIME)
            await asyncio.sleep(for_s)
            spells.append((begins_s, time.clock_gettime(time.CLOCK_BOOTTIME)))
    return spells


@asynccontextmanager
async def _viewers(url: str, count: int) -> AsyncIterator[None]:
    """Watch as so many pages."""
    async with ClientSession() as session:
        origin = url.partition("/?")[0]
        sockets = [await session.ws_connect(f"{origin}/ws", headers={"Origin": origin}) for _ in range(count)]
        looking = [asyncio.create_task(_look(socket)) for socket in sockets]
        yield
        for each in looking:
            each.cancel()
        await asyncio.gather(*looking, return_exceptions=True)


async def _look(socket: ClientWebSocketResponse) -> None:
    """Acknowledge as a page does."""
    seen = 0
    async for _ in socket:
        seen += 1
        await socket.send_str(json.dumps({"seen": seen}))


if __name__ == "__main__":
    print_table(HEADER, [figure.row() for figure in figures(runs=3, for_s=12.0)])
