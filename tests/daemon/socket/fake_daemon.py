"""A daemon that only notes what it is told, and a raw client that may misbehave."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from tests.children import child
from wayfarer.daemon.socket.protocol import Details, RequestRefused
from wayfarer.daemon.socket.server import ControlServer
from wayfarer.safety.permission import Asked

ARM = b'{"do": "arm", "asked_s": 1.5}\n'
STATUS = b'{"do": "status"}\n'


class FakeDaemon:
    """Notes every command; ``fails_with`` is raised by ``hold``, ``waits`` keeps ``arm`` from ending."""

    def __init__(self) -> None:
        self.told: list[tuple[object, ...]] = []
        self.asked: list[Asked] = []
        self.errors: list[Exception] = []
        self.fails_with: Exception = RequestRefused("nothing to hold: arm first")
        self.answers: Details = {"mode": "disarmed"}
        self.waits = asyncio.Event()
        self.waits.set()

    @property
    def being_checked(self) -> bool:
        return not self.waits.is_set()

    async def status(self) -> Details:
        self.told.append(("status",))
        return self.answers

    async def arm(self, asked: Asked, heading_deg: float | None = None, *, without_log: bool = False) -> Details:
        self.asked.append(asked)
        self.told.append(("arm", heading_deg))
        try:
            await self.waits.wait()
        except asyncio.CancelledError:
            self.told.append(("gave up",))
            raise
        return {"start_delay_s": 10.0}

    async def disarm(self) -> Details:
        self.told.append(("disarm",))
        return {}

    async def hold(self) -> Details:
        raise self.fails_with

    async def resume(self, asked: Asked) -> Details:
        self.asked.append(asked)
        self.told.append(("resume",))
        return {}

    async def goal(self, heading_deg: float) -> Details:
        self.told.append(("goal", heading_deg))
        return {}

    async def manual_begin(self, asked: Asked, driver: str) -> Details:
        self.asked.append(asked)
        self.told.append(("manual_begin", driver))
        return {"lease": 7}

    async def manual_drive(self, lease: int, seq: int, forward: float, turn: float, sent_s: float) -> Details:
        self.told.append(("manual_drive", lease, seq, forward, turn, sent_s))
        return {}

    async def manual_end(self, lease: int) -> Details:
        self.told.append(("manual_end", lease))
        return {}

    async def mark(self, text: str, *, keep: bool = True) -> Details:
        self.told.append(("mark", text))
        return {}

    async def link_lost(self, text: str) -> Details:
        self.told.append(("link_lost", text))
        return {}

    async def stop(self) -> Details:
        self.told.append(("stop",))
        return {}


def serve(daemon: FakeDaemon, path: Path, declination_deg: float | None = 3.5, **limits: Any) -> ControlServer:
    return ControlServer(path, daemon, declination_deg=declination_deg, on_error=daemon.errors.append, **limits)


def open_files() -> int:
    """How many files and sockets this process holds."""
    return len(list(Path("/proc/self/fd").iterdir()))


class RawClient:
    """Sends any bytes; ``async with`` closes it."""

    def __init__(self, path: Path) -> None:
        self._path = path

    async def __aenter__(self) -> RawClient:
        while True:
            try:
                self.reader, self.writer = await asyncio.open_unix_connection(str(self._path))
                return self
            except BlockingIOError:  # the queue of the server is full for the moment
                await asyncio.sleep(0.001)

    async def __aexit__(self, *_: object) -> None:
        self.writer.transport.abort()
        await asyncio.sleep(0)

    async def reply_to(self, data: bytes) -> dict[str, Any]:
        self.writer.write(data)
        return await self.reply()

    async def reply(self) -> dict[str, Any]:
        line = await asyncio.wait_for(self.reader.readline(), 2.0)
        reply: dict[str, Any] = msgspec.json.decode(line)
        return reply

    async def is_closed(self) -> bool:
        """Wait for the server to close; what it had sent before is dropped."""
        try:
            while await asyncio.wait_for(self.reader.read(65_536), 2.0):
                pass
        except ConnectionError:  # closed with something unread
            return True
        except TimeoutError:
            return False
        return True


async def answers(path: Path) -> bool:
    """Whether the server at this path still answers."""
    async with RawClient(path) as client:
        return (await client.reply_to(STATUS))["ok"] is True


async def until(happened: Callable[[], object]) -> None:
    """Give the server a moment; fail if it does not happen."""
    async with asyncio.timeout(2.0):
        while not happened():  # noqa: ASYNC110  (nothing there tells of it)
            await asyncio.sleep(0.002)


HOLDER = """
import sys
from pathlib import Path
from importlib import import_module
module, name, path = sys.argv[1:]
with getattr(import_module(module), name)(Path(path) if name == "single_daemon" else path):
    print("held", flush=True)
    sys.stdin.read()
"""


@contextmanager
def held_elsewhere(lock: Callable[..., object], path: object) -> Iterator[int]:
    """Have another process hold a lock, and kill it at the end; yields its number."""
    arguments = [sys.executable, "-c", HOLDER, lock.__module__, lock.__name__, str(path)]
    with child(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        yield holder.pid
