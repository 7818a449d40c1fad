"""What clients of the control socket may use up: lines, time, places, replies; and that a stop always gets in."""

# ruff: noqa: ASYNC220 - attackers are real processes
from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import orjson
import pytest

from tests.daemon.socket.fake_daemon import STATUS, FakeDaemon, RawClient, answers, open_files, serve, until
from wayfarer.daemon.socket.client import ask
from wayfarer.daemon.socket.protocol import REQUEST_BYTES
from wayfarer.daemon.socket.server import SocketLimits

QUICK = SocketLimits(line_s=0.05, idle_s=0.1, reply_s=0.05)


async def test_line_of_just_the_limit_is_read_and_one_byte_more_is_refused(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        async with RawClient(path) as client:
            assert (await client.reply_to(STATUS[:-1].ljust(REQUEST_BYTES) + b"\n"))["ok"]
        for too_long in (STATUS[:-1].ljust(REQUEST_BYTES + 1) + b"\n", b"x" * 1_000_000):
            async with RawClient(path) as client:
                reply = await client.reply_to(too_long)
                assert reply == {"ok": False, "why": "a line has 8192 bytes at most: the connection is closed"}
                assert await client.is_closed()
        assert daemon.told == [("status",)]
        assert await answers(path)


async def test_byte_after_byte_does_not_prolong_a_line(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path, QUICK._replace(idle_s=60.0)):
        with socket.socket(socket.AF_UNIX) as slow:
            slow.connect(str(path))
            slow.setblocking(False)
            with suppress(BrokenPipeError):
                for byte in STATUS[:9]:
                    slow.send(bytes([byte]))
                    await asyncio.sleep(0.01)
            assert b"the line did not end within 0.05 s: " in slow.recv(1000)
            with suppress(ConnectionResetError):  # closed with something unread
                assert slow.recv(1000) == b"", "it is closed"


async def test_idle_client_is_closed(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path, QUICK), RawClient(path) as client:
        assert (await client.reply_to(STATUS))["ok"]
        assert (await client.reply())["why"].startswith("idle for 0.1 s: ")
        assert await client.is_closed()


async def test_line_cut_off_by_the_client_is_not_obeyed(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as client:
        client.writer.write(b'{"do": "arm"}')
        client.writer.write_eof()
        assert "the line does not end" in (await client.reply())["why"]
    assert daemon.told == []


async def test_new_client_takes_the_place_of_the_one_silent_longest(path: Path, daemon: FakeDaemon) -> None:
    async with (
        serve(daemon, path, SocketLimits(clients=3)) as serving,
        RawClient(path) as one,
        RawClient(path) as two,
        RawClient(path) as three,
    ):
        for client in (two, three, one):  # not in the order in which they came
            assert (await client.reply_to(STATUS))["ok"]
        await until(lambda: not serving._under_way)
        assert await answers(path)
        why = (await two.reply())["why"]
        assert why.startswith("disconnected to make room for another client, as the one silent longest: ")
        assert await two.is_closed()
        for client in (one, three):
            assert (await client.reply_to(STATUS))["ok"]


async def test_request_under_way_is_not_dropped_for_a_new_client_but_half_a_line_is(
    path: Path, daemon: FakeDaemon
) -> None:
    daemon.waits.clear()
    async with serve(daemon, path, SocketLimits(clients=2)), RawClient(path) as busy:
        busy.writer.write(b'{"do": "arm"}\n')
        await until(lambda: daemon.told)
        async with RawClient(path) as begun:
            begun.writer.write(STATUS[:9])
            assert await answers(path)
            assert (await begun.reply())["why"].startswith("disconnected to make room for another client")
            assert await begun.is_closed()
        async with RawClient(path) as second:
            second.writer.write(b'{"do": "arm"}\n')
            await until(lambda: len(daemon.told) == 3)
            async with RawClient(path) as third:
                assert (await third.reply())["why"].startswith("2 clients are being answered, which is the limit: ")
                assert await third.is_closed()
            daemon.waits.set()
            assert (await second.reply())["ok"]
        assert (await busy.reply())["ok"]
        assert await answers(path)


# What 16 clients may do that they never end; the last asks for more than it reads.
HOGS = {
    "nothing": b"",
    "half a line": b"{",
    "lines without end": STATUS * 2000,
    "no reading": b'{"do": "arm"}\n' * 2000,
}


@pytest.mark.parametrize("said", HOGS.values(), ids=HOGS)
async def test_clients_that_take_all_places_keep_no_stop_out(path: Path, daemon: FakeDaemon, said: bytes) -> None:
    daemon.answers = {"text": "x" * 1000}
    async with serve(daemon, path):
        hogs = [await RawClient(path).__aenter__() for _ in range(16)]
        for hog in hogs:
            hog.writer.write(said)
        await asyncio.sleep(0.02)
        for _ in range(3):
            async with RawClient(path) as client:
                assert await client.reply_to(b'{"do": "stop"}\n') == {"ok": True}
        for hog in hogs:
            await hog.__aexit__()


# What careless scripts may send on connections that they make again and again, and keep 30 of.
FLOODS = {"half a line": b"{", "a request": STATUS, "many requests": STATUS * 100, "nothing": b""}


ATTACK = """
import socket, sys
kept = []
while True:
    one = socket.socket(socket.AF_UNIX)
    kept.append(one)
    try:
        one.connect(sys.argv[1])
        one.sendall(bytes.fromhex(sys.argv[2]))
    except OSError:
        pass
    if len(kept) > 30:
        kept.pop(0).close()
"""


@pytest.mark.process
@pytest.mark.parametrize("stops", [40, pytest.param(400, marks=pytest.mark.long)])
@pytest.mark.parametrize("said", FLOODS.values(), ids=FLOODS)
async def test_flood_of_new_clients_refuses_no_stop(path: Path, daemon: FakeDaemon, said: bytes, stops: int) -> None:
    """The attackers are processes: as threads they would wait for the server."""
    async with serve(daemon, path):
        attackers = [subprocess.Popen([sys.executable, "-c", ATTACK, str(path), said.hex()]) for _ in range(4)]
        try:
            await asyncio.sleep(0.5)
            for _ in range(stops):
                await asyncio.to_thread(ask, {"do": "stop"}, path)
        finally:
            for attacker in attackers:
                attacker.kill()
                attacker.wait()
    assert daemon.told.count(("stop",)) == stops


async def test_client_that_never_reads_is_dropped_and_holds_nothing(path: Path, daemon: FakeDaemon) -> None:
    daemon.answers = {"text": "x" * 60_000}
    async with serve(daemon, path, QUICK._replace(idle_s=60.0)) as serving:
        before = open_files()
        with socket.socket(socket.AF_UNIX) as deaf:
            deaf.connect(str(path))
            deaf.setblocking(False)
            deaf.send(STATUS * 1000)
            await until(lambda: serving._clients)
            await until(lambda: not serving._clients)
            await asyncio.sleep(0)
            assert len(daemon.told) < 100
            assert open_files() == before + 1
        daemon.answers = {}
        assert await answers(path)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6, 10])  # of replies: the kernel buffers some three of them
async def test_client_that_reads_late_gets_every_reply_whole(path: Path, daemon: FakeDaemon, count: int) -> None:
    daemon.answers = {"text": "x" * 60_000}
    async with serve(daemon, path):
        with socket.socket(socket.AF_UNIX) as late:
            late.connect(str(path))
            late.setblocking(False)
            late.send(STATUS * count)
            late.shutdown(socket.SHUT_WR)
            await asyncio.sleep(0.02)
            received = b""
            while data := await asyncio.get_running_loop().sock_recv(late, 1_000_000):
                received += data
    assert [orjson.loads(line)["text"] for line in received.splitlines()] == ["x" * 60_000] * count


async def test_clients_that_come_together_all_get_in(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        clients = [socket.socket(socket.AF_UNIX) for _ in range(16)]
        for client in clients:
            client.setblocking(False)
            client.connect(str(path))
            client.send(STATUS)
        await until(lambda: len(daemon.told) == 16)
        answers = [await asyncio.get_running_loop().sock_recv(client, 10_000) for client in clients]
        for client in clients:
            client.close()
    assert all(orjson.loads(answer)["ok"] for answer in answers)


async def test_a_thousand_connections_leave_the_server_as_it_was(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path) as serving:
        clients = [await RawClient(path).__aenter__() for _ in range(16)]
        for _ in range(984):
            clients.append(await RawClient(path).__aenter__())
            dropped = clients.pop(0)
            assert "silent longest" in (await dropped.reply())["why"]
            await dropped.__aexit__()
        assert len(serving._clients) == 16
        for client in clients:
            await client.__aexit__()
        await until(lambda: not serving._clients)
        assert serving._under_way == set()
        assert await answers(path)
