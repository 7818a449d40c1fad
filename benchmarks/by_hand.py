"""Driving by hand, in a running daemon: from a key to the tick that acts on it, and from the last key to the stop."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Iterator
from itertools import chain, pairwise, repeat
from pathlib import Path
from random import Random
from typing import Any

from benchmarks.daemon import daemon
from benchmarks.figures import Figure
from wayfarer.daemon.socket.client import Connection

STOPS = 5
STOPS_WITHIN_MS = 350.0  # the deadman of the rover file as shipped, and a tick
REACTS_WITHIN_MS = 100.0  # two ticks; a person needs twice as long


def figures(for_s: float) -> list[Figure]:
    """Press keys for so many seconds at times that no tick knows, then let go some times."""
    with tempfile.TemporaryDirectory() as folder, daemon(Path(folder), "--manual") as (process, _):
        with Connection(Path(folder) / "control.sock") as connection:
            _drive(connection, for_s)
            connection.ask({"do": "stop"})
        process.wait()
        ticks = list(_ticks(Path(folder)))
    return [
        Figure("by hand: from a key to the wheels", "ms", _reactions_ms(ticks), REACTS_WITHIN_MS),
        Figure("by hand: the wheels stand after the last key", "ms", _stops_ms(ticks), STOPS_WITHIN_MS),
    ]


def _drive(connection: Connection, for_s: float) -> None:
    random = Random(0)
    lease = connection.ask({"do": "manual_begin", "driver": "keys"})["lease"]
    periods_s = (random.uniform(0.02, 0.06) for _ in range(round(for_s / 0.04)))
    stops_s = chain.from_iterable([*repeat(0.04, 10), 0.6] for _ in range(STOPS))
    for seq, period_s in enumerate(chain(periods_s, stops_s), start=1):
        forward = 0.2 if seq > 3 else 0.0  # first that everything was let go
        sample = {"seq": seq, "forward": forward, "turn": 4.0 * forward, "sent_s": time.monotonic()}
        connection.ask({"do": "manual_drive", "lease": lease, **sample})
        time.sleep(period_s)


def _ticks(folder: Path) -> Iterator[dict[str, Any]]:
    (log,) = folder.glob("logs/*/run.jsonl")
    for record in map(json.loads, log.read_text().splitlines()):
        if record["record"] == "tick" and "manual_seq" in record:
            yield record


def _reactions_ms(ticks: list[dict[str, Any]]) -> list[float]:
    """Return how long each sample took that a tick acted on."""
    first = {tick["manual_seq"]: tick for tick in reversed(ticks)}
    return [1000.0 * (tick["t_s"] - tick["manual_sent_s"]) for tick in first.values()]


def _stops_ms(ticks: list[dict[str, Any]]) -> list[float]:
    """Return how long after its newest sample each stop came that nobody asked for."""
    return [
        1000.0 * (tick["t_s"] - tick["manual_sent_s"])
        for before, tick in pairwise(ticks)
        if before["applied_left"] and not tick["applied_left"] and tick["manual_forward"]
    ]
