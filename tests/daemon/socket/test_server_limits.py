"""What clients of the control socket may use up: lines, time, places, replies; and that a stop always gets in."""

# ruff: noqa: ASYNC220 - attackers are real processes
from __future__ import annotations

import asyncio
import resource
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from tests.daemon.socket.fake_daemon import ARM, STATUS, FakeDaemon, RawClient, answers, open_files, serve, until
from wayfarer.daemon.socket import server
from wayfarer.daemon.socket.client import ask
from wayfarer.daemon.socket.protocol import REQUEST_BYTES, STOPPING, Details
from wayfarer.daemon.socket.server import CLIENTS, PAUSE_S, ControlServer


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


async def test_line_cut_off_by_the_client_is_not_obeyed(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path), RawClient(path) as client:
        client.writer.write(ARM[:-1])
        client.writer.write_eof()
        assert "the line does not end" in (await client.reply())["why"]
    assert daemon.told == []


async def test_client_that_came_first_gives_up_its_place_and_hears_why(path: Path, daemon: FakeDaemon) -> None:
    """Whatever it does: here it waits for its arming, which is given up with it."""
    daemon.waits.clear()
    async with serve(daemon, path, clients=2), RawClient(path) as busy, RawClient(path) as begun:
        busy.writer.write(ARM)
        await until(lambda: daemon.told)
        begun.writer.write(STATUS[:9])
        async with RawClient(path) as third:
            assert (await third.reply_to(b'{"do": "stop"}\n'))["ok"]
            assert (await busy.reply())["why"].startswith("too many clients: this one was here longest")
            assert await busy.is_closed()
            begun.writer.write(STATUS[9:])
            assert (await begun.reply())["ok"], "the others keep theirs"


async def test_stop_waits_for_no_turn(path: Path, daemon: FakeDaemon) -> None:
    """Else 16 clients that never cease to ask would keep it waiting behind all their requests."""
    async with serve(daemon, path):
        asking = [await RawClient(path).__aenter__() for _ in range(CLIENTS - 1)]
        for each in asking:
            each.writer.write(STATUS * 400)
        await until(lambda: len(daemon.told) > CLIENTS)
        async with RawClient(path) as client:
            before = len(daemon.told)
            for verb in ("disarm", "stop"):
                assert (await client.reply_to(b'{"do": "%s"}\n' % verb.encode()))["ok"]
            assert len(daemon.told) - before < CLIENTS, "its connection is accepted meanwhile, and nothing else"
        for each in asking:
            await each.__aexit__()


async def test_a_millisecond_is_for_one_answer_and_one_new_client(path: Path, daemon: FakeDaemon) -> None:
    """Without a pause they would take the interpreter from the threads of the buses."""
    loop = asyncio.get_running_loop()
    async with serve(daemon, path) as serving:
        asking = [await RawClient(path).__aenter__() for _ in range(8)]
        began_s = loop.time()
        for each in asking:
            each.writer.write(STATUS * 20)
        await until(lambda: len(daemon.told) >= 100)
        assert loop.time() - began_s >= 100 * PAUSE_S
        began_s, known = loop.time(), set(serving._clients)
        crowd = [socket.socket(socket.AF_UNIX) for _ in range(16)]
        for line in crowd:
            line.setblocking(False)
            line.connect(str(path))
        await until(lambda: not known & set(serving._clients))
        assert loop.time() - began_s >= 15 * PAUSE_S
        for line in crowd:
            line.close()
        for each in asking:
            await each.__aexit__()


# What as many clients as there are places may do that they never end; the last asks for more than it reads.
HOGS = {
    "nothing": b"",
    "half a line": b"{",
    "lines without end": STATUS * 2000,
    "no reading": ARM * 2000,
}


@pytest.mark.parametrize("said", HOGS.values(), ids=HOGS)
async def test_clients_that_take_all_places_keep_nobody_out(path: Path, daemon: FakeDaemon, said: bytes) -> None:
    daemon.answers = {"text": "x" * 1000}
    async with serve(daemon, path):
        hogs = [await RawClient(path).__aenter__() for _ in range(CLIENTS)]
        for hog in hogs:
            hog.writer.write(said)
        await asyncio.sleep(0.02)
        for line in (b'{"do": "stop"}\n', b'{"do": "disarm"}\n', STATUS, ARM):
            async with RawClient(path) as client:
                assert (await client.reply_to(line))["ok"]
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
    async with serve(daemon, path, unread_s=0.05) as serving:
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
    assert [msgspec.json.decode(line)["text"] for line in received.splitlines()] == ["x" * 60_000] * count


async def test_request_that_is_there_is_answered_before_its_client_is_pushed_out(
    path: Path, daemon: FakeDaemon
) -> None:
    async with serve(daemon, path, clients=8):
        clients = [socket.socket(socket.AF_UNIX) for _ in range(60)]
        for number, client in enumerate(clients):
            client.setblocking(False)
            await until(lambda: client.connect_ex(str(path)) == 0)  # noqa: B023 - few wait to be accepted
            client.send(b'{"do": "mark", "text": "%d"}\n' % number + STATUS * 100)
        await until(lambda: {each[1] for each in daemon.told if each[0] == "mark"} == {str(n) for n in range(60)})
        for client in clients:
            client.close()


async def test_stop_that_has_come_counts_though_its_client_is_pushed_out(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path, clients=1) as serving, RawClient(path) as client:
        await until(lambda: serving._clients)
        (first,) = serving._clients
        first._unread = b'{"do": "stop"}\n'  # read in the turn in which another one is accepted
        serving._push_out()
        assert daemon.told == [("stop",)]
        assert await client.reply() == {"ok": True}
        assert "too many" in (await client.reply())["why"]


async def test_a_thousand_connections_leave_the_server_as_it_was(path: Path, daemon: FakeDaemon) -> None:
    async with serve(daemon, path) as serving:
        clients = [await RawClient(path).__aenter__() for _ in range(CLIENTS)]
        for _ in range(968):
            clients.append(await RawClient(path).__aenter__())
            dropped = clients.pop(0)
            assert await dropped.is_closed()
            await dropped.__aexit__()
        assert len(serving._clients) == CLIENTS
        for client in clients:
            await client.__aexit__()
        await until(lambda: not serving._clients)
        assert await answers(path)


async def test_no_timer_and_no_task_is_left_behind(path: Path, daemon: FakeDaemon) -> None:
    """Each would stay for as long as it was meant to last: thousands of clients a minute would hold up the loop."""
    loop = asyncio.get_running_loop()
    daemon.answers = {"text": "x" * 60_000}
    async with serve(daemon, path) as serving:
        tasks = len(asyncio.all_tasks())
        timers = len(loop._scheduled)  # type: ignore[attr-defined]
        for said in (b"", b"{", STATUS, ARM, STATUS * 20, b"x" * 10_000) * 5:
            async with RawClient(path) as client:
                client.writer.write(said)
                await asyncio.sleep(0.01)
        await until(lambda: not serving._clients)
        await asyncio.sleep(10 * PAUSE_S)
        left = [timer for timer in loop._scheduled if not timer.cancelled()]  # type: ignore[attr-defined]
        assert len(left) <= timers
        assert len(asyncio.all_tasks()) == tasks


@pytest.mark.parametrize("others", [0, 4])
async def test_without_a_file_descriptor_the_newest_client_still_gets_in(
    path: Path, daemon: FakeDaemon, others: int
) -> None:
    """In the place of another, or with the descriptor that is kept for it, again and again."""
    async with serve(daemon, path) as serving:
        idle = [await RawClient(path).__aenter__() for _ in range(others)]
        await until(lambda: len(serving._clients) == others)
        before = resource.getrlimit(resource.RLIMIT_NOFILE)
        for count in range(1, 4):
            with socket.socket(socket.AF_UNIX) as late:
                late.setblocking(False)
                late.connect(str(path))
                late.send(b'{"do": "stop"}\n')
                resource.setrlimit(resource.RLIMIT_NOFILE, (late.fileno() + 1, before[1]))
                try:
                    await until(lambda: len(daemon.told) == count)  # noqa: B023
                finally:
                    resource.setrlimit(resource.RLIMIT_NOFILE, before)
                assert b'"ok":true' in late.recv(1000)
            await until(lambda: len(serving._clients) <= others)
        for client in idle:
            await client.__aexit__()


WITHOUT_MEMORY = """
import asyncio, resource, sys
from pathlib import Path
from tests.daemon.socket.fake_daemon import FakeDaemon, serve

async def main():
    daemon = FakeDaemon()
    async def held(): return {}
    daemon.hold = held
    async with serve(daemon, Path(sys.argv[1])):
        taken = [bytearray(100_000) for _ in range(20)]
        deep = []
        for _ in range(900):
            deep = [deep]
        repr(deep)  # the stack cannot grow any more under the limit: the interpreter would crash
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        try:
            while True:
                taken.append(bytearray(100_000))  # asyncio's streams read into 256 KiB; the interpreter needs some
        except MemoryError:
            print("ready", flush=True)
        await asyncio.sleep(60)

asyncio.run(main())
"""


@pytest.mark.process
def test_where_no_memory_is_left_a_stop_still_gets_in(path: Path) -> None:
    """Half requests hold all places, and the process may have no more memory than it has."""
    with subprocess.Popen(
        [sys.executable, "-c", WITHOUT_MEMORY, str(path)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        half: list[socket.socket] = []
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            half = [socket.socket(socket.AF_UNIX) for _ in range(40)]
            for each in half:
                each.connect(str(path))
                each.sendall(b'{"do": "mark", "text": "' + b"x" * 4_000)
            for verb in ("stop", "hold", "disarm") * 5:
                assert ask({"do": verb}, path) == {}
        finally:
            process.kill()
            for each in half:
                each.close()


@pytest.mark.parametrize("verb", sorted(STOPPING))
async def test_stop_that_finds_no_memory_is_tried_once_more_with_what_is_kept(
    path: Path, daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch, verb: str
) -> None:
    kept: list[bool] = []

    async def stop() -> Details:
        kept.append(serving._spare_memory is not None)
        if kept[-1]:
            raise MemoryError
        return {}

    monkeypatch.setattr(daemon, verb, stop)
    async with serve(daemon, path) as serving:
        for _ in range(2):  # it is kept again for the next
            async with RawClient(path) as client:
                assert await client.reply_to(b'{"do": "%s"}\n' % verb.encode()) == {"ok": True}
            await until(lambda: not serving._clients)
    assert kept == [True, False] * 2
    assert daemon.errors == []


async def test_what_finds_no_memory_twice_is_refused(path: Path, daemon: FakeDaemon) -> None:
    daemon.fails_with = MemoryError()
    async with serve(daemon, path), RawClient(path) as client:
        assert "an error inside wayfarer (MemoryError" in (await client.reply_to(b'{"do": "hold"}\n'))["why"]
        assert (await client.reply_to(STATUS))["ok"]
    assert daemon.errors == [daemon.fails_with]


class Short(asyncio.SelectorEventLoop):
    """A loop that finds no memory for each second handle of the server's."""

    fails = False
    failed = 0

    def _fail(self) -> None:
        if self.fails:
            self.failed += 1
            if self.failed % 2:
                raise MemoryError

    def add_reader(self, fd: Any, callback: Any, *args: Any) -> None:  # type: ignore[override]
        """Add a reader, each second time only."""
        self._fail()
        super().add_reader(fd, callback, *args)

    def add_writer(self, fd: Any, callback: Any, *args: Any) -> None:  # type: ignore[override]
        """Add a writer, each second time only."""
        self._fail()
        super().add_writer(fd, callback, *args)

    def call_later(  # type: ignore[override]
        self, delay: float, callback: Any, *args: Any, context: Any = None
    ) -> asyncio.TimerHandle:
        """Set a timer, each second time only."""
        if getattr(callback, "__module__", "").startswith("wayfarer"):
            self._fail()
        return super().call_later(delay, callback, *args, context=context)


def test_handle_that_finds_no_memory_keeps_nobody_waiting_for_good(path: Path) -> None:
    """Whichever it is: of accepting, of a line that has come, of room for an answer, of a turn."""

    async def asks() -> None:
        loop, daemon = asyncio.get_running_loop(), FakeDaemon()
        assert isinstance(loop, Short)
        async with serve(daemon, path):
            for count in range(1, 10):
                with socket.socket(socket.AF_UNIX) as line:
                    line.setblocking(False)
                    line.connect(str(path))
                    line.send(b'{"do": "stop"}\n' if count % 2 else STATUS * 2)
                    loop.fails = True
                    await until(lambda: len(daemon.told) >= count)  # noqa: B023
                    loop.fails = False
        assert loop.failed > 9

    with asyncio.Runner(loop_factory=Short) as runner:
        runner.run(asks())


async def test_accepting_that_finds_no_memory_goes_on_with_the_next(
    path: Path, daemon: FakeDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries: list[object] = []
    begin = server._Client.__init__

    def short(self: server._Client, serving: ControlServer, connection: socket.socket) -> None:
        tries.append(connection)
        if len(tries) == 1:
            raise MemoryError
        begin(self, serving, connection)

    async with serve(daemon, path):
        monkeypatch.setattr(server._Client, "__init__", short)
        async with RawClient(path):
            await until(lambda: tries)
            assert await answers(path)
    for lost in tries[:1]:
        assert isinstance(lost, socket.socket)
        lost.close()
