"""The server of the process beside the daemon, met by a real WebSocket client."""

from __future__ import annotations

import asyncio
import json
import socket
import subprocess
import sys
from base64 import b64decode
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from struct import unpack_from
from typing import Any, Protocol

import pytest
from aiohttp import ClientConnectionError, ClientSession, ClientWebSocketResponse, ClientWSTimeout, WSMsgType

from tests.views.foxglove.logs import HEADER, tick
from tests.views.foxglove.readers import Descriptors
from tests.views.foxglove.test_scene import WORLD
from wayfarer.errors import BadInput
from wayfarer.fieldlog.schema import Record
from wayfarer.views.foxglove.server import CONNECTIONS, FoxgloveServer

PROTOCOL = "foxglove.sdk.v1"
UPGRADE = (
    b"GET / HTTP/1.1\r\nHost: rover\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)
MESSAGE, TIME = 1, 2  # the first byte of what the server sends
PATIENCE_S = 10.0
Message = tuple[str, int, dict[str, Any]]


class Shows(Protocol):
    """What records are given to: the server, or the process around it."""

    def show(self, record: Record) -> None:
        """Take a record."""


class Client:
    """A viewer: subscribes to every channel that it is told of, and decodes what it gets."""

    def __init__(self, socket: ClientWebSocketResponse) -> None:
        self._socket = socket
        self.server: dict[str, Any] = {}
        self.channels: dict[int, dict[str, Any]] = {}
        self.time_ns = 0

    async def subscribe(self) -> None:
        self.server = await self._socket.receive_json(timeout=PATIENCE_S)
        advertised = await self._socket.receive_json(timeout=PATIENCE_S)
        assert advertised["op"] == "advertise"
        self.channels = {channel["id"]: channel for channel in advertised["channels"]}
        subscriptions = [{"id": number, "channelId": number} for number in self.channels]
        await self._socket.send_json({"op": "subscribe", "subscriptions": subscriptions})

    async def receive(self, timeout_s: float) -> Message:
        message = await self._socket.receive(timeout=timeout_s)
        assert message.type is WSMsgType.BINARY
        if message.data[0] == TIME:
            (self.time_ns,) = unpack_from("<xQ", message.data)
            return await self.receive(timeout_s)
        opcode, subscription, time_ns = unpack_from("<BIQ", message.data)
        assert opcode == MESSAGE
        channel, payload = self.channels[subscription], message.data[13:]
        if channel["encoding"] == "json":
            return channel["topic"], time_ns, json.loads(payload)
        schema = Descriptors(b64decode(channel["schema"]))
        return channel["topic"], time_ns, schema.decode(f".{channel['schemaName']}", payload)

    async def see(self, live: Shows, *topics: str) -> dict[str, Message]:
        """The first message of each of these topics, while the rover stands and its ticks go on."""
        found: dict[str, Message] = {}
        async with asyncio.timeout(PATIENCE_S):
            t_s = 1000.0
            while not found.keys() >= set(topics):
                live.show(tick(t_s := t_s + 0.05, motion=None))
                try:
                    while True:
                        message = await self.receive(0.02)
                        found.setdefault(message[0], message)
                except TimeoutError:
                    continue
        return found


@asynccontextmanager
async def connected(port: int) -> AsyncIterator[Client]:
    timeout = ClientWSTimeout(ws_close=0.1)  # one that reads nothing does not see the other's farewell
    async with (
        ClientSession() as session,
        session.ws_connect(address(port), protocols=[PROTOCOL], timeout=timeout) as websocket,
    ):
        assert websocket.protocol == PROTOCOL
        client = Client(websocket)
        await client.subscribe()
        yield client


def address(port: int) -> str:
    return f"ws://127.0.0.1:{port}"


@asynccontextmanager
async def served() -> AsyncIterator[FoxgloveServer]:
    server = FoxgloveServer(port=0)
    yield server
    server.stop()


def driven(live: Shows, ticks: int = 10) -> None:
    """A run that has been going on for a while, in a simulated forest."""
    live.show({**HEADER, "world": WORLD})
    for number in range(ticks):
        live.show(tick(101.0 + number))


async def test_viewer_gets_what_is_shown_with_its_time() -> None:
    async with served() as live, connected(live.port) as client:
        await client.see(live, "/heading")  # it has subscribed
        live.show(tick(2000.0, heading_deg=123.0, pitch_deg=4.5))
        while (found := await client.receive(PATIENCE_S))[:2] != ("/heading", 1_800_001_900_000_000_000):
            pass
        assert found[2] == {"heading_deg": 123.0, "goal_heading_deg": 90.0, "error_deg": -33.0}
        assert (await client.receive(PATIENCE_S))[2] == {"pitch_deg": 4.5, "roll_deg": 0.0}


async def test_every_channel_is_announced_with_its_schema_and_no_way_to_ask_anything_of_the_rover() -> None:
    async with served() as live, connected(live.port) as client:
        topics = {channel["topic"]: channel for channel in client.channels.values()}
        assert (client.server["name"], client.server["capabilities"]) == ("wayfarer", ["time"])
    assert {"/pose", "/track", "/forest", "/phase", "/log", "/location", "/anomalies"} <= topics.keys()
    assert topics["/pose"]["schemaName"] == "foxglove.FrameTransform"
    assert "phase" in json.loads(topics["/phase"]["schema"])["properties"]


async def test_each_viewer_who_comes_late_gets_forest_bodies_and_the_whole_path() -> None:
    async with served() as live:
        driven(live)
        async with connected(live.port) as first:
            await first.see(live, "/forest")
            async with connected(live.port) as client:
                found = await client.see(live, "/forest", "/rover", "/track", "/pose")
    assert client.time_ns >= found["/pose"][1] > 1_800_000_900_000_000_000, "the viewer's clock is the rover's"
    assert len(found["/forest"][2]["entities"][0]["cylinders"]) == 2
    assert [entity["id"] for entity in found["/rover"][2]["entities"]] == ["rover", "truth"]
    points = found["/track"][2]["entities"][0]["lines"][0]["points"]
    assert [point["x"] for point in points[:10]] == [25.5 + 0.5 * number for number in range(10)]


async def test_it_listens_on_this_computer_only() -> None:
    async with served() as live:
        socket.create_connection(("127.0.0.1", live.port)).close()
        with pytest.raises(ConnectionRefusedError):  # as a server on all addresses would not
            socket.create_connection(("127.0.0.2", live.port))


async def test_web_page_from_elsewhere_is_let_in_as_the_docs_say() -> None:
    """Should the SDK refuse it one day, the paragraph in docs/how-to/foxglove.md can go."""
    foreign = {"Origin": "http://elsewhere.example", "Host": "rebound.elsewhere.example"}
    async with (
        served() as live,
        ClientSession() as session,
        session.ws_connect(address(live.port), protocols=[PROTOCOL], headers=foreign) as websocket,
    ):
        assert (await websocket.receive_json(timeout=PATIENCE_S))["op"] == "serverInfo"


async def test_viewer_that_ceases_to_read_holds_up_nobody() -> None:
    async with served() as live, connected(live.port) as mute:
        await mute.see(live, "/pose")
        for number in range(5000):  # far more than is kept for a viewer
            live.show(tick(2000.0 + number))
            await asyncio.sleep(0.0)  # as the control loop does after each tick
        async with connected(live.port) as client:
            assert "/pose" in await client.see(live, "/pose")


LOST_VIEWER = f"""
import socket, struct, threading
from wayfarer.views.foxglove.server import FoxgloveServer

live = FoxgloveServer(port=0)
with socket.create_connection(("127.0.0.1", live.port)) as viewer:
    viewer.sendall({UPGRADE!r})
    assert viewer.recv(12) == b"HTTP/1.1 101"
    viewer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # the wireless is gone
threading.Event().wait(0.3)
"""


@pytest.mark.process
def test_viewer_that_is_lost_prints_nothing() -> None:
    """In a process of its own: pytest's logging would keep the line from the terminal."""
    ended = subprocess.run([sys.executable, "-c", LOST_VIEWER], capture_output=True, text=True, check=True)
    assert (ended.stdout, ended.stderr) == ("", "")


async def test_stopped_server_lets_nobody_in() -> None:
    async with served() as live:
        port = live.port
    live.show(tick(1.0))
    async with ClientSession() as session:
        with pytest.raises(ClientConnectionError):
            await session.ws_connect(address(port), protocols=[PROTOCOL])


async def test_connections_beyond_the_limit_are_all_closed_and_viewers_come_back() -> None:
    async with served() as live, connected(live.port) as client:
        idle = [await asyncio.open_connection("127.0.0.1", live.port) for _ in range(CONNECTIONS - 1)]
        live.sweep()
        assert "/pose" in await client.see(live, "/pose"), "as many as allowed"
        idle.append(await asyncio.open_connection("127.0.0.1", live.port))
        async with asyncio.timeout(PATIENCE_S):
            while not idle[0][0].at_eof():
                live.sweep()
                await asyncio.sleep(0.01)
            for reader, writer in idle:
                assert await reader.read() == b""
                writer.close()
            async with connected(live.port) as again:
                assert "/pose" in await again.see(live, "/pose")


def test_address_of_another_computer_is_refused_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.views.foxglove.server.HOST", "203.0.113.1")
    with pytest.raises(BadInput, match=r"cannot be served at 203\.0\.113\.1 port 0: .*Cannot assign requested address"):
        FoxgloveServer(port=0)
