"""A bad network between a browser and a daemon: ``python -m tests.remote.live.relay PORT``, told how on its stdin.

TCP loses nothing: a packet that is lost arrives after it was sent again, and all that came after it waits for it. So a
loss is a pause here. Each line on stdin is a JSON object with the values of ``Network`` that change.
"""

from __future__ import annotations

import asyncio
import json
import random
import subprocess
import sys
from asyncio import StreamReader, StreamWriter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from tests.children import child

AGAIN_S = 0.2  # Linux's shortest time until it sends again (TCP_RTO_MIN)


@dataclass
class Network:
    """How it is now, in each direction."""

    delay_s: float = 0.0
    jitter_s: float = 0.0  # in addition, from 0 to this
    loss: float = 0.0  # from 0 to 1
    cut: bool = False  # nothing arrives, and neither side is told

    def arrives_s(self, now_s: float, dice: random.Random) -> float:
        lost_s = AGAIN_S if dice.random() < self.loss else 0.0
        return now_s + self.delay_s + dice.uniform(0.0, self.jitter_s) + lost_s


class Relay:
    """The process that relays, seen from the test."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        assert process.stdout is not None
        self.port = int(process.stdout.readline())

    def set(self, **values: float) -> None:
        assert self._process.stdin is not None
        print(json.dumps(values), file=self._process.stdin, flush=True)


@contextmanager
def relaying(port: int) -> Iterator[Relay]:
    """Relay to a port of this computer."""
    command = [sys.executable, "-m", "tests.remote.live.relay", str(port)]
    with child(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield Relay(process)


async def relay(port: int) -> None:
    """Relay until stdin ends."""
    network, dice = Network(), random.Random(1)

    async def serve(reader: StreamReader, writer: StreamWriter) -> None:
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", port)
        await asyncio.gather(pump(reader, far_writer, network, dice), pump(far_reader, writer, network, dice))

    server = await asyncio.start_server(serve, "127.0.0.1")
    print(server.sockets[0].getsockname()[1], flush=True)
    while line := await asyncio.to_thread(sys.stdin.readline):
        for name, value in json.loads(line).items():
            setattr(network, name, value)


async def pump(reader: StreamReader, writer: StreamWriter, network: Network, dice: random.Random) -> None:
    """Carry bytes in one direction, each piece no sooner than the one before."""
    loop = asyncio.get_running_loop()
    under_way: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()

    async def deliver() -> None:
        while True:
            arrives_s, data = await under_way.get()
            await asyncio.sleep(arrives_s - loop.time())
            while network.cut:  # noqa: ASYNC110 - not worth an event
                await asyncio.sleep(0.01)
            if not data or writer.is_closing():
                writer.close()
                return
            writer.write(data)

    delivering = asyncio.create_task(deliver())
    while not delivering.done():
        try:
            data = await reader.read(65_536)
        except ConnectionError:
            data = b""
        under_way.put_nowait((network.arrives_s(loop.time(), dice), data))
        if not data:
            await delivering


if __name__ == "__main__":
    asyncio.run(relay(int(sys.argv[1])))
