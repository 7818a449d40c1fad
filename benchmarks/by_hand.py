"""Driving by hand, over the socket of a running daemon's live page.

From a sample of the hands to the tick that acts on it, and from the last sample to the stop.
"""

from __future__ import annotations

import asyncio
import json
import re
import tempfile
import time
from collections.abc import Iterator
from itertools import chain, pairwise, repeat
from pathlib import Path
from random import Random

from aiohttp import ClientSession, ClientWebSocketResponse

from benchmarks.daemon import daemon
from benchmarks.figures import Figure
from wayfarer.daemon.socket.client import ask
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import Manual, Tick

STOPS = 5
STOPS_WITHIN_MS = 350.0  # the deadman of the rover file as shipped, and a tick
REACTS_WITHIN_MS = 100.0  # two ticks; a person needs twice as long


def figures(for_s: float) -> list[Figure]:
    """Drive as a page does for so many seconds, at times that no tick knows, then fall silent some times."""
    options = ("--manual", "--live", "--live-port", "0")
    with tempfile.TemporaryDirectory() as folder, daemon(Path(folder), *options) as (process, _):
        assert process.stdout is not None
        address = re.search(r"(http://\S+)/\?(token=\S+)", process.stdout.readline())
        assert address is not None
        asyncio.run(_drive(address[1], address[2], for_s))
        ask({"do": "stop"}, Path(folder) / "control.sock")
        process.wait()
        ticks = list(_ticks(Path(folder)))
    return [
        Figure("by hand: from a sample to the wheels", "ms", _reactions_ms(ticks), REACTS_WITHIN_MS),
        Figure("by hand: wheels stopped after the last sample", "ms", _stops_ms(ticks), STOPS_WITHIN_MS),
    ]


async def _drive(origin: str, token: str, for_s: float) -> None:
    async with (
        ClientSession(headers={"Origin": origin}) as session,
        session.ws_connect(f"{origin}/ws?{token}") as socket,
    ):
        page = _Page(socket)
        await page.ask({"do": "manual_begin"})
        await _send_samples(page, for_s)


class _Page:
    """Acknowledges states and asks as a page does, but for the clock: it is the rover's own here."""

    def __init__(self, socket: ClientWebSocketResponse) -> None:
        self._socket = socket
        self._seen = 0

    async def ask(self, request: dict[str, object]) -> None:
        """Send a request and wait until it is done."""
        now_s = time.clock_gettime(time.CLOCK_BOOTTIME)
        await self._socket.send_json({**request, "asked_s": now_s, "sent_s": now_s})
        async for message in self._socket:
            told = json.loads(message.data)
            if any("state" in piece for piece in told):
                self._seen += 1
                await self._socket.send_json({"seen": self._seen})
            for reply in (piece["reply"] for piece in told if "reply" in piece):
                assert reply["ok"], reply["why"]
                return


async def _send_samples(page: _Page, for_s: float) -> None:
    random = Random(0)
    periods_s = (random.uniform(0.02, 0.06) for _ in range(round(for_s / 0.04)))
    stops_s = chain.from_iterable([*repeat(0.04, 10), 0.6] for _ in range(STOPS))
    for seq, period_s in enumerate(chain(periods_s, stops_s), start=1):
        forward = 0.2 if seq > 3 else 0.0  # first that everything was let go
        await page.ask({"do": "manual_drive", "seq": seq, "forward": forward, "turn": 4.0 * forward})
        await asyncio.sleep(period_s)


def _ticks(folder: Path) -> Iterator[tuple[Tick, Manual]]:
    (run,) = folder.glob("logs/0*")  # beside the last mission's file
    for record in RunReader(run):
        if isinstance(record, Tick) and record.manual is not None:
            yield record, record.manual


def _reactions_ms(ticks: list[tuple[Tick, Manual]]) -> list[float]:
    """Return how long each sample took that a tick acted on."""
    first = {manual.seq: (tick, manual) for tick, manual in reversed(ticks)}
    return [1000.0 * (tick.t_s - manual.sent_s) for tick, manual in first.values()]


def _stops_ms(ticks: list[tuple[Tick, Manual]]) -> list[float]:
    """Return how long after its newest sample each stop came that nobody asked for."""
    return [
        1000.0 * (tick.t_s - manual.sent_s)
        for (before, _), (tick, manual) in pairwise(ticks)
        if before.applied_left and not tick.applied_left and manual.forward
    ]
