"""What viewers do that nobody should: old presses, floods, requests that are none."""

from __future__ import annotations

import asyncio
import socket
from contextlib import suppress
from typing import Any

import aiohttp
import aiohttp.web
import pytest

from tests.remote.live.test_server import TOKEN, first, pieces, serving
from wayfarer.remote.live.access import RECEIVED_BYTES, address_to_open, bind
from wayfarer.remote.live.model import LIMITS

ENDS = {aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSING, aiohttp.WSMsgType.CLOSED}


async def test_resume_reaches_the_rover_from_a_page_of_now_alone() -> None:
    shown: dict[str, list[object]] = {
        "not held": [0.0, 0.5],  # seconds ago: it reaches the rover
        "press again": [1.1, 3600.0, -1.1, None, "now", [], {}],  # it waited, or its page is of another run
    }
    async with serving() as site:
        for why, at in ((why, at) for why, ages in shown.items() for at in ages):
            async with site.connect() as connection:
                now_s = asyncio.get_running_loop().time()
                asked_s = now_s - at if isinstance(at, float) else at
                await connection.send_json({"do": "resume", "asked_s": asked_s})
                assert why in (await first(connection, "reply"))["why"], at


async def test_permission_is_of_the_newest_time_that_the_page_was_told_and_ends_with_its_connection() -> None:
    async with serving() as site, site.connect() as connection:
        asked_s = (await first(connection, "state"))["now_s"]
        await connection.send_json({"do": "resume", "asked_s": asked_s})
        await first(connection, "reply")
        assert site.rover.permissions == [(asked_s, True)]
        await connection.send_json({"do": "resume", "asked_s": asked_s})
        connection.get_extra_info("socket").shutdown(socket.SHUT_WR)  # both wait for the daemon
        async with asyncio.timeout(5.0):
            while len(site.rover.permissions) < 2:  # noqa: ASYNC110  (nothing there tells of it)
                await asyncio.sleep(0.01)
        assert site.rover.permissions[1] == (asked_s, False)


async def test_state_says_while_the_rover_is_being_checked() -> None:
    async with serving() as site, site.connect() as connection:
        assert (await first(connection, "snapshot"))["state"]["being_checked"] is False
        site.rover.being_checked = True
        async for state in pieces(connection, "state"):
            if state["being_checked"]:
                return
    raise AssertionError("the page was not told")


async def test_marks_are_limited_and_stopping_is_not() -> None:
    async with serving() as site, site.connect() as connection:
        for request in [{"do": "mark", "text": "log"}] * 20 + [{"do": "hold"}] * 20 + [{"do": "stop"}]:
            await connection.send_json(request)
        replies: list[Any] = []
        async for reply in pieces(connection, "reply"):
            replies.append(reply)
            if reply["do"] == "stop":
                break
    marks = [reply for reply in replies if reply["do"] == "mark"]
    assert LIMITS.requests <= sum(reply["ok"] for reply in marks) < 2 * LIMITS.requests
    assert "wait a second" in marks[-1]["why"]
    assert all(reply["ok"] for reply in replies if reply["do"] != "mark")


async def test_request_too_deep_to_be_sent_back_is_refused_and_the_connection_stays() -> None:
    deep: Any = "hold"
    for _ in range(300):  # more than can be encoded, and fewer than are read
        deep = [deep]
    async with serving() as site, site.connect() as connection:
        await connection.send_json({"do": deep})
        reply = await first(connection, "reply")
        assert (reply["ok"], reply["do"]) == (False, None)
        await connection.send_json({"do": "hold"})
        assert (await first(connection, "reply"))["ok"]


@pytest.mark.parametrize("send", ["ping", "pong"])
async def test_who_pings_is_cut_off(send: str) -> None:
    async with serving() as site, site.connect() as connection, asyncio.timeout(5.0):
        await getattr(connection, send)()
        kinds = [(await connection.receive()).type]
        while kinds[-1] not in ENDS and len(kinds) < 100:
            kinds.append((await connection.receive()).type)
    assert kinds[-1] in ENDS


def test_little_is_received_in_one_turn_of_the_loop() -> None:
    with bind("127.0.0.1", 0) as listening, socket.create_connection(listening.getsockname()):
        accepted, _ = listening.accept()
        with accepted:
            assert accepted.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) <= 2 * RECEIVED_BYTES


async def test_socket_that_is_asked_for_as_a_page_is_refused_in_words() -> None:
    async with serving() as site, site.client.get(f"{site.url}ws", headers={"Origin": site.origin}) as response:
        assert response.status == 400
        assert "open /" in await response.text()


@pytest.mark.parametrize(
    "header",
    [
        b"Upgrade: \x80",
        b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: \x80",
    ],
)
async def test_socket_that_is_asked_for_in_bytes_that_are_no_text_is_refused_in_words(header: bytes) -> None:
    async with serving() as site:
        host = site.origin.removeprefix("http://").encode()
        asked = b"GET /ws HTTP/1.1\r\nHost: %s\r\nOrigin: http://%s\r\n%s\r\n\r\n" % (host, host, header)
        assert (await site.answer(asked)).startswith(b"HTTP/1.1 400 ")


async def test_every_address_of_this_computer_means_both_kinds() -> None:
    with bind("::", 0) as listening:
        assert address_to_open(listening, TOKEN).endswith(f"?token={TOKEN}")
        port = listening.getsockname()[1]
        for host in ("127.0.0.1", "::1"):
            _, writer = await asyncio.open_connection(host, port)
            writer.close()


async def test_crowd_is_accepted_one_at_a_time_and_leaves_no_timer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred connections each 30 ms, which need no token, held up the loop for 0.3 s, and with it the wheels."""
    accepted = 0
    begin = aiohttp.web.RequestHandler.connection_made

    def count(self: aiohttp.web.RequestHandler, transport: asyncio.BaseTransport) -> None:
        nonlocal accepted
        accepted += 1
        begin(self, transport)

    monkeypatch.setattr(aiohttp.web.RequestHandler, "connection_made", count)
    async with serving(limits=LIMITS._replace(connections=4)) as site, asyncio.timeout(10.0):
        crowd = [socket.socket() for _ in range(100)]
        for each in crowd:
            each.setblocking(False)
            with suppress(BlockingIOError):
                each.connect(("127.0.0.1", site.port))
        in_a_turn = []
        while accepted < 100:
            before = accepted
            await asyncio.sleep(0)
            in_a_turn.append(accepted - before)
        assert max(in_a_turn) == 1
        timers = asyncio.get_running_loop()._scheduled  # type: ignore[attr-defined]
        assert len([each for each in timers if not each.cancelled()]) < 10
        assert len(site.page._open()) <= 4
        for each in crowd:
            each.close()


@pytest.mark.parametrize("error", [OSError, MemoryError, ValueError])
async def test_connection_that_cannot_be_begun_keeps_the_next_from_nothing(
    monkeypatch: pytest.MonkeyPatch, error: type[Exception], caplog: pytest.LogCaptureFixture
) -> None:
    tried = 0
    loop = asyncio.get_running_loop()
    connect = loop.connect_accepted_socket

    async def fails(*args: Any) -> Any:
        nonlocal tried
        tried += 1
        if tried == 1:
            raise error("at once")
        return await connect(*args)

    monkeypatch.setattr(loop, "connect_accepted_socket", fails)
    async with serving() as site, asyncio.timeout(5.0):
        with socket.create_connection(("127.0.0.1", site.port)):
            while not tried:  # noqa: ASYNC110  (nothing there tells of it)
                await asyncio.sleep(0.01)
        async with site.client.get(site.url) as response:
            assert response.status == 200
    assert ("in accepting" in caplog.text) == (error is ValueError)
