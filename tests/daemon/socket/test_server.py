"""The server answers whatever comes, bounds what clients may use up, and goes on."""

# ruff: noqa: ASYNC220, TID251 - attackers are real processes, in real time
from __future__ import annotations

import asyncio
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from stat import S_IMODE
from typing import Any

import orjson
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.daemon.socket.fake_daemon import FakeDaemon, RawClient, open_files, serve
from wayfarer.daemon.socket import server
from wayfarer.daemon.socket.client import ask
from wayfarer.daemon.socket.protocol import REQUEST_BYTES, VERBS
from wayfarer.daemon.socket.server import SocketLimits
from wayfarer.errors import BadInput, NotResponding

STATUS = b'{"do": "status"}\n'
QUICK = SocketLimits(line_s=0.05, idle_s=0.1, reply_s=0.05)


async def answers(path: Path) -> bool:
    async with RawClient(path) as client:
        return (await client.reply_to(STATUS))["ok"] is True


async def until(happened: Callable[[], object]) -> None:
    """Give the server a moment; a test that waits in vain fails."""
    async with asyncio.timeout(2.0):
        while not happened():  # noqa: ASYNC110  (nothing there tells of it)
            await asyncio.sleep(0.002)


def mode_of(path: Path) -> int:
    return S_IMODE(path.stat().st_mode)


# -- answering -----------------------------------------------------------------------------------------------------


async def test_command_is_answered_with_its_details(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as client:
        assert await client.reply_to(STATUS) == {"ok": True, "mode": "disarmed"}
        assert await client.reply_to(b'{"do": "goal", "heading_deg": 10, "north": "true"}\n') == {"ok": True}
    assert daemon.told == [("status",), ("goal", 6.5)]


async def test_lines_sent_together_are_answered_in_order(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as client:
        client.writer.write(b"".join(b'{"do": "mark", "text": "%d"}\n' % number for number in range(100)))
        assert [await client.reply() for _ in range(100)] == [{"ok": True}] * 100
    assert daemon.told == [("mark", str(number)) for number in range(100)]


async def test_refusal_says_why_and_the_connection_stays(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as client:
        assert await client.reply_to(b'{"do": "hold"}\n') == {"ok": False, "why": "nothing to hold: arm first"}
        assert (await client.reply_to(STATUS))["ok"]
    assert daemon.errors == []


async def test_error_for_a_person_is_a_refusal(path: Path, daemon: FakeDaemon) -> None:
    daemon.fails_with = NotResponding("motor board at 0x15: no answer; check its power")
    async with serve(daemon, path), RawClient(path) as client:
        assert (await client.reply_to(b'{"do": "hold"}\n'))["why"] == "motor board at 0x15: no answer; check its power"
    assert daemon.errors == []


async def test_bug_in_a_command_is_reported_and_the_server_goes_on(path: Path, daemon: FakeDaemon) -> None:
    daemon.fails_with = ZeroDivisionError("x" * 1000)
    async with serve(daemon, path), RawClient(path) as client:
        reply = await client.reply_to(b'{"do": "hold"}\n')
        assert (await client.reply_to(STATUS))["ok"]
    assert reply["ok"] is False
    assert "an error inside wayfarer (ZeroDivisionError: xxx" in reply["why"]
    assert len(reply["why"]) < 300
    assert daemon.errors == [daemon.fails_with]


async def test_details_that_are_no_json_are_reported_as_a_bug(path: Path, daemon: FakeDaemon) -> None:
    daemon.answers = {"mode": object()}
    async with serve(daemon, path), RawClient(path) as client:
        assert (await client.reply_to(STATUS))["ok"] is False
    assert [type(error).__name__ for error in daemon.errors] == ["TypeError"]


async def test_stop_does_not_queue_behind_a_slow_arm(path: Path, daemon: FakeDaemon) -> None:
    daemon.waits.clear()
    async with serve(daemon, path), RawClient(path) as one, RawClient(path) as other:
        one.writer.write(b'{"do": "arm"}\n')
        await until(lambda: daemon.told)
        assert await other.reply_to(b'{"do": "stop"}\n') == {"ok": True}
        daemon.waits.set()
        assert await one.reply() == {"ok": True, "start_delay_s": 10.0}


async def test_flood_of_many_clients_gets_one_answer_in_each_turn_of_the_loop(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as one, RawClient(path) as two, RawClient(path) as three:
        for client in (one, two, three):
            client.writer.write(STATUS * 300)
        await until(lambda: daemon.told)
        before, turns = len(daemon.told), 0
        while len(daemon.told) < 300:
            await asyncio.sleep(0)
            turns += 1
        assert turns >= 300 - before


async def test_flood_of_one_client_keeps_no_other_waiting(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as loud, RawClient(path) as other:
        loud.writer.write(STATUS * 1000)
        await until(lambda: daemon.told)
        other.writer.write(b'{"do": "stop"}\n')
        await until(lambda: ("stop",) in daemon.told)
        assert daemon.told.index(("stop",)) < 500


# -- bounds --------------------------------------------------------------------------------------------------------


async def test_line_of_just_the_limit_is_read_and_one_byte_more_is_refused(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        async with RawClient(path) as client:
            assert (await client.reply_to(STATUS[:-1].ljust(REQUEST_BYTES) + b"\n"))["ok"]
        async with RawClient(path) as client:
            reply = await client.reply_to(STATUS[:-1].ljust(REQUEST_BYTES + 1) + b"\n")
            assert reply == {"ok": False, "why": "a line has 8192 bytes at most: the connection is closed"}
            assert await client.is_closed()
    assert daemon.told == [("status",)]


async def test_endless_line_gets_one_refusal_and_is_closed(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        async with RawClient(path) as client:
            reply = await client.reply_to(b"x" * 1_000_000)
            assert "8192 bytes at most" in reply["why"]
            assert await client.is_closed()
        assert await answers(path)


async def test_half_a_line_is_closed_when_its_time_is_over(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path, QUICK._replace(idle_s=60.0)), RawClient(path) as client:
        assert (await client.reply_to(STATUS[:9]))["why"].startswith("the line did not end within 0.05 s: ")
        assert await client.is_closed()


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
        assert (await two.reply())["why"].startswith("dropped for another client, as the one silent longest: ")
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
            assert (await begun.reply())["why"].startswith("dropped for another client")
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


@pytest.mark.slow
@pytest.mark.parametrize("said", FLOODS.values(), ids=FLOODS)
def test_flood_of_new_clients_refuses_no_stop_and_makes_no_tick_late(path: Path, said: bytes) -> None:
    """The attackers are processes: as threads they would wait for the server."""
    with asyncio.Runner() as runner:
        late_s, took_s = runner.run(stops_amid(path, said))
    print(f"{len(took_s)} stops, at worst after {max(took_s):.3f} s; ticks late by {max(late_s):.3f} s at worst")
    assert len(took_s) == STOPS
    assert sorted(late_s)[len(late_s) // 2] < 0.01


STOPS = 100
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


async def stops_amid(path: Path, said: bytes) -> tuple[list[float], list[float]]:
    """Ask to stop while four processes connect as quickly as they can; return how late ticks are, and the answers."""
    loop, late_s = asyncio.get_running_loop(), []

    async def tick() -> None:
        due_s = loop.time()
        while True:
            due_s += 0.05
            await asyncio.sleep(due_s - loop.time())
            late_s.append(loop.time() - due_s)

    async with serve(FakeDaemon(), path):
        ticking = asyncio.create_task(tick())
        attackers = [subprocess.Popen([sys.executable, "-c", ATTACK, str(path), said.hex()]) for _ in range(4)]
        try:
            await asyncio.sleep(0.5)
            return late_s, await asyncio.to_thread(ask_to_stop, path)
        finally:
            ticking.cancel()
            for attacker in attackers:
                attacker.kill()
                attacker.wait()


def ask_to_stop(path: Path) -> list[float]:
    took_s = []
    for _ in range(STOPS):
        began_s = time.monotonic()
        ask({"do": "stop"}, path)
        took_s.append(time.monotonic() - began_s)
    return took_s


async def test_forgotten_clients_keep_no_stop_out(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        forgotten = [await RawClient(path).__aenter__() for _ in range(16)]
        for _ in range(3):
            async with RawClient(path) as client:
                assert await client.reply_to(b'{"do": "stop"}\n') == {"ok": True}
        for each in forgotten:
            await each.__aexit__()


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


# -- who may ask ---------------------------------------------------------------------------------------------------


async def test_socket_is_the_owners_alone(path: Path, daemon: FakeDaemon) -> None:
    before = os.umask(0)
    try:
        async with serve(daemon, path):
            assert mode_of(path) == 0o600
    finally:
        os.umask(before)


@pytest.mark.parametrize(("peer", "own"), [(1001, 1000), (1001, 0)])
async def test_another_user_is_turned_away(
    path: Path, daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch, peer: int, own: int
) -> None:
    monkeypatch.setattr(server, "peer_uid", lambda _: peer)
    monkeypatch.setattr(os, "geteuid", lambda: own)
    async with serve(daemon, path), RawClient(path) as client:
        reply = await client.reply_to(b'{"do": "stop"}\n')
        assert reply == {"ok": False, "why": f"this daemon obeys user {own} and root only, not user 1001: use sudo"}
        assert await client.is_closed()
    assert daemon.told == []


@pytest.mark.parametrize("peer", [0, 1000])
async def test_the_owner_and_root_are_admitted(
    path: Path, daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch, peer: int
) -> None:
    monkeypatch.setattr(server, "peer_uid", lambda _: peer)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    async with serve(daemon, path):
        assert await answers(path)


def test_peer_is_who_the_kernel_says() -> None:
    one, other = socket.socketpair(socket.AF_UNIX)
    with one, other:
        assert server.peer_uid(one) == os.geteuid()


# -- begin and end -------------------------------------------------------------------------------------------------


async def test_end_of_the_server_closes_its_clients(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        client = await RawClient(path).__aenter__()
        assert (await client.reply_to(STATUS))["ok"]
    assert await client.is_closed()
    await client.__aexit__()


async def test_reply_to_stop_arrives_though_the_server_ends(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path):
        client = await RawClient(path).__aenter__()
        client.writer.write(b'{"do": "stop"}\n')
        await until(lambda: daemon.told)
    assert await client.reply() == {"ok": True}
    await client.__aexit__()


@pytest.mark.parametrize(
    ("name", "reason"), [("nowhere/control.sock", "No such file"), ("x" * 108, "too long"), ("taken", "in use")]
)
async def test_socket_that_cannot_be_made_is_the_users_to_mend(
    path: Path, daemon: FakeDaemon, name: str, reason: str
) -> None:
    (path.parent / "taken").touch()
    with pytest.raises(BadInput, match=f"the control socket cannot be made: .*{reason}"):
        await serve(daemon, path.parent / name).__aenter__()


# -- anything ------------------------------------------------------------------------------------------------------

VALUE: st.SearchStrategy[object] = st.sampled_from(
    [0, 12.5, 360, -1, 1e300, True, None, "true", "magnetic", "", "x", [], {}]
)
LINE = st.one_of(
    st.dictionaries(st.sampled_from(["heading_deg", "north", "text", "x"]), VALUE)
    .flatmap(lambda keys: st.sampled_from([*VERBS, "x"]).map(lambda verb: {"do": verb, **keys}))
    .map(lambda fields: orjson.dumps(fields) + b"\n"),
    st.binary(max_size=300).map(lambda data: data + b"\n"),
)


def test_every_line_of_any_bytes_gets_one_answer(path: Path) -> None:
    daemon = FakeDaemon()

    @given(data=st.lists(LINE | st.binary(max_size=300), max_size=6).map(b"".join))
    @example(data=b"\0\xff\n\n{}\n\r\n")
    @example(data=b"\n" * 1000)
    @example(data=STATUS[:-1])
    def answers_each(data: bytes) -> None:
        half = data.rpartition(b"\n")[2]
        replies = runner.run(conversation(path, data))
        assert len(replies) == data.count(b"\n") + bool(half)
        assert all(reply["ok"] is True or (reply["ok"] is False and reply["why"]) for reply in replies)
        assert runner.run(answers(path))

    with asyncio.Runner() as runner:
        serving = serve(daemon, path)
        runner.run(serving.__aenter__())
        answers_each()
        runner.run(serving.__aexit__(None, None, None))
    assert daemon.errors == []


async def conversation(path: Path, data: bytes) -> list[dict[str, Any]]:
    """Send it all, and return every reply."""
    async with RawClient(path) as client:
        client.writer.write(data)
        client.writer.write_eof()
        return [orjson.loads(line) for line in (await client.reader.read(-1)).splitlines()]
