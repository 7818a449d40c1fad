"""A thousand missions in one daemon, in which nothing may grow.

It is the daemon of ``wayfarer run --sim`` with its log, threads and live page, a viewer of that, and a client of its
socket that arms, asks, holds and marks. Its event loop has real sockets and a clock that jumps, so a mission takes as
long as its ticks are computed. Each is ended by its limit of distance; a person ends every third by disarming.
``--idle-s`` lets the rover stand disarmed between two of them: with 250 s, a thousand take three days.
"""

from __future__ import annotations

import asyncio
import gc
import threading
import time
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import msgspec
from aiohttp import ClientSession, ClientWebSocketResponse

from benchmarks.figures import print_table
from benchmarks.soak import HOUR_S, MB, carry_back, open_files, resident_mb
from benchmarks.stock_loop import JumpingStockLoop
from wayfarer.config.rover_file import RoverConfig, laid_over, load_rover
from wayfarer.daemon.daemon import Daemon, RoverSetup, Service
from wayfarer.daemon.socket.protocol import STARTING
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.remote.live.server import LivePage
from wayfarer.simhal.build_rover import build
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.simhal.world.physics import Depth, Physics
from wayfarer.simhal.world.world import World

TOKEN = "of the benchmark"
SEED = 0
POLL_S = 0.5
SHARES = (0.01, 0.1, 0.5, 1.0)  # of the missions, after which it is measured
WRITER_S = 0.25  # real time: the log's thread writes five times per second, and must not fall behind this clock
SETTINGS = {
    "safety": {"start_delay_s": 0.0, "settle_s": 0.2, "mission_distance_m": 2.0},
    "log": {"part_mb": 1.0, "run_mb": 10.0, "free_mb": 0.0},
}
# How much more there may be at the end than at the second measurement. A mission that left one object would leave 900.
MAY_GROW = {"rss_mb": 6.0, "objects": 500.0, "tasks": 0.0, "threads": 0.0, "files": 0.0}


class Sample(NamedTuple):
    """How things were after so many missions."""

    missions: int
    hours: float
    rss_mb: float
    objects: int
    tasks: int
    threads: int
    files: int
    log_mb: float
    log_files: int
    dropped: int


def missions(folder: Path, count: int, idle_s: float) -> list[Sample]:
    """Run so many missions, each followed by ``idle_s`` disarmed, in one daemon; return samples.

    Its socket and its log are in the folder, whose path must be short.
    """
    with asyncio.Runner(loop_factory=JumpingStockLoop) as runner:
        return runner.run(_missions(folder, count, idle_s))


def growth(samples: Sequence[Sample], **slacks: float) -> list[str]:
    """Return what grew from the second to the last sample, and what the log lost or took beyond its limit.

    ``slacks`` are other ones than in ``MAY_GROW``.
    """
    before, after = samples[1], samples[-1]
    most_mb = SETTINGS["log"]["run_mb"] + SETTINGS["log"]["part_mb"]
    found = [
        f"{name} grew from {getattr(before, name):g} to {getattr(after, name):g}; {slack:g} more are allowed"
        for name, slack in {**MAY_GROW, **slacks}.items()
        if getattr(after, name) > getattr(before, name) + slack
    ]
    found += [f"the log took {each.log_mb:.1f} MB of {most_mb:g}" for each in samples if each.log_mb > most_mb][:1]
    return found + ([f"the log lost {after.dropped} records"] if after.dropped else [])


def print_missions(count: int, idle_s: float) -> int:
    """Print the samples as a table and the verdict; return 1 if something grew."""
    with TemporaryDirectory(prefix="wf-") as folder:
        samples = missions(Path(folder), count, idle_s)
    header = ("missions", "hours", "RSS MB", "objects", "tasks", "threads", "open files", "log MB", "log files", "lost")
    print_table(header, [_cells(sample) for sample in samples])
    problems = growth(samples)
    print("\n" + ("\n".join(problems) if problems else "nothing grew"))
    return 1 if problems else 0


# -- the rover and its daemon ------------------------------------------------------------------------------------------


class Forester:
    """Makes the rover of the daemon, and puts it back to where it began."""

    def __init__(self, config: RoverConfig) -> None:
        self._config = config
        self._forest: Forest = generate_forest(SEED, 0, SEED)

    def make_rover(self, _finish: Callable[[str, str], None]) -> RoverSetup:
        """Return the rover, as ``daemon.daemon.Service`` wants it; no end of the world ends the run."""
        clock, streams = asyncio.get_running_loop().time, RandomStreams(SEED)
        self.world = World(self._forest, self._config.vehicle, Physics(), streams, starts_s=clock())
        return RoverSetup(build(Depth.DEVICE, self.world, streams, self._config, clock), checks=())

    def carry_back(self) -> None:
        """Carry the rover back if it has left the forest."""
        carry_back(self._forest, self.world)


async def _missions(folder: Path, count: int, idle_s: float) -> list[Sample]:
    config = laid_over(load_rover("sim"), SETTINGS)
    forester, page = Forester(config), LivePage("127.0.0.1", 0, TOKEN)
    service = Service(
        config, CATALOGUE["forest-pledge"], SEED, forester.make_rover, folder / "logs", folder / "socket",
        simulated=True, dry_run=False, viewers=[page],
    )  # fmt: skip
    run = asyncio.create_task(Daemon(service).run())
    await asyncio.sleep(1.0)
    samples: list[Sample] = []
    async with _client(service.socket) as ask, _viewer(page):
        for number in range(1, count + 1):
            forester.carry_back()
            await _mission(ask, number)
            await asyncio.sleep(idle_s)
            time.sleep(WRITER_S if number % 10 == 0 else 0.0)  # noqa: ASYNC251 - this clock stands meanwhile
            if number in {max(1, round(share * count)) for share in SHARES}:
                samples.append(_sample(number, folder / "logs", (await ask("status"))["log_dropped"]))
        await ask("stop")
    await run
    return samples


Ask = Callable[..., Any]


async def _mission(ask: Ask, number: int) -> None:
    """Arm, drive with a hold and a mark, and wait for the end; every third mission is ended by a person."""
    await ask("arm", heading_deg=float(number % 360))
    await asyncio.sleep(1.0)
    await ask("hold")
    await ask("mark", text=f"mission {number}")
    await ask("resume")
    if number % 3 == 0:
        await ask("disarm")
    while (told := await ask("status"))["mode"] != "disarmed":  # noqa: ASYNC110 - as a person who watches
        await asyncio.sleep(POLL_S)
    if told["why_disarmed"] not in {"mission_distance", "requested by a person"}:
        raise SystemExit(f"mission {number} ended by: {told['why_disarmed']}")


@asynccontextmanager
async def _client(path: Path) -> AsyncIterator[Ask]:
    """Give a function that asks the daemon over its socket, with a new connection each time, as a command does."""

    async def ask(do: str, **keys: object) -> dict[str, Any]:
        if do in STARTING:
            await asyncio.sleep(POLL_S)  # this clock stands between two requests, and what is asked next must be later
            keys["asked_s"] = asyncio.get_running_loop().time()
        reader, writer = await asyncio.open_unix_connection(path)
        writer.write(msgspec.json.encode({"do": do, **keys}) + b"\n")
        told: dict[str, Any] = msgspec.json.decode(await reader.readline())
        writer.close()
        await writer.wait_closed()
        if not told.pop("ok"):
            raise SystemExit(f"{do} was refused: {told}")
        return told

    yield ask


@asynccontextmanager
async def _viewer(page: LivePage) -> AsyncIterator[None]:
    """Have the live page open, in a browser that takes everything."""
    address = page.url.partition("/?")[0]
    async with ClientSession() as session, session.ws_connect(f"{address}/ws", headers={"Origin": address}) as socket:
        looking = asyncio.create_task(_look(socket))
        yield
        looking.cancel()


async def _look(socket: ClientWebSocketResponse) -> None:
    seen = 0
    async for message in socket:
        if any("state" in piece for piece in msgspec.json.decode(message.data)):
            seen += 1
            await socket.send_str(f'{{"seen":{seen}}}')


def _sample(number: int, logs: Path, dropped: int) -> Sample:
    gc.collect()
    files = [path for path in logs.rglob("*") if path.is_file()]
    return Sample(
        number,
        asyncio.get_running_loop().time() / HOUR_S,
        resident_mb(),
        len(gc.get_objects()),
        len(asyncio.all_tasks()),
        threading.active_count(),
        open_files(),
        sum(path.stat().st_size for path in files) / MB,
        len(files),
        dropped,
    )


def _cells(sample: Sample) -> tuple[str, ...]:
    number, hours, rss_mb, *counted = sample
    shown = [f"{each:.1f}" if isinstance(each, float) else str(each) for each in counted]
    return str(number), f"{hours:.1f}", f"{rss_mb:.1f}", *shown
