"""The control socket: the real server before hostile clients, and the client before a hostile server."""

from __future__ import annotations

import asyncio
import json
import socket
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from itertools import pairwise
from pathlib import Path

from hypothesis import strategies as st

from tests.daemon.socket.fake_daemon import FakeDaemon, open_files, serve
from tests.fuzz.damage import as_json, bytes_of, json_of
from tests.fuzz.target import Target, Try, reading, shape
from wayfarer.daemon.socket.client import ask
from wayfarer.daemon.socket.protocol import REQUEST_BYTES, VERBS, check, ok_reply, read_line

REQUESTS = [
    {"do": "status"}, {"do": "arm", "asked_s": 5.5, "heading_deg": 12.5, "north": "true"},
    {"do": "goal", "heading_deg": 0}, {"do": "mark", "text": "hit log"}, {"do": "stop"}, {"do": "hold", "why": None},
]  # fmt: skip
LINES = [as_json(request) + b"\n" for request in REQUESTS]
WORDS = [
    b'"do"',
    b'"heading_deg"',
    b'{"do":"status","do":"stop"}\n',
    b"\n\n",
    *(f'"{verb}"'.encode() for verb in VERBS),
]
MOST_OPEN = 20  # files and sockets more than before: each client has two ends here
LONG_S = 20.0  # this machine may be busy


def _lines() -> st.SearchStrategy[bytes]:
    damaged = bytes_of([b"".join(LINES), *LINES], WORDS)
    return damaged | json_of(REQUESTS, 3).map(lambda request: as_json(request) + b"\n")


# -- the protocol as functions ---------------------------------------------------------------------------------------


PROTOCOL = Target(
    "protocol",
    _lines(),
    lambda: nullcontext(lambda line: reading(lambda: f"{check(read_line(line)).do} is asked for")),
)


# -- the server ------------------------------------------------------------------------------------------------------


def _pieces(content: bytes, cuts: Sequence[int]) -> list[bytes]:
    """Return a content in pieces, cut anywhere."""
    edges = sorted({0, len(content), *(cut % (len(content) + 1) for cut in cuts)})
    return [content[begin:end] for begin, end in pairwise(edges)]


CLIENTS = st.lists(  # what each sends, and whether it stays to hear the replies
    st.tuples(st.builds(_pieces, _lines(), st.lists(st.integers(0, 9_999), max_size=4)), st.booleans()),
    min_size=1,
    max_size=6,
)


@contextmanager
def _served() -> Iterator[Try]:
    daemon = FakeDaemon()
    with tempfile.TemporaryDirectory(prefix="wf-") as folder, asyncio.Runner() as runner:
        path = Path(folder) / "control.sock"
        server = serve(daemon, path, clients=4, unread_s=0.5)
        runner.run(server.__aenter__())
        open_before = open_files()

        def attempt(clients: list[tuple[list[bytes], bool]]) -> str:
            daemon.told.clear()
            daemon.errors.clear()
            said = runner.run(_talked(path, clients))
            assert not daemon.errors, daemon.errors
            assert open_files() <= open_before + MOST_OPEN
            return said

        yield attempt
        runner.run(server.__aexit__(None, None, None))


async def _talked(path: Path, clients: list[tuple[list[bytes], bool]]) -> str:
    """Have all clients talk at once, then see that a good one is answered."""
    async with asyncio.timeout(LONG_S):
        said = await asyncio.gather(*(_client(path, *client) for client in clients))
    async with asyncio.timeout(LONG_S):  # it may be turned away until those who left have been answered
        while await _client(path, [LINES[0]], stays=True) != ["ok"]:  # noqa: ASYNC110 - nothing there tells of it
            await asyncio.sleep(0.01)
    return " ".join(sorted({each for replies in said for each in replies}))


async def _client(path: Path, pieces: list[bytes], stays: bool) -> list[str]:
    """Send pieces; return what was said to each line, in a word or two."""
    reader, writer = await asyncio.open_unix_connection(str(path))
    try:
        with suppress(ConnectionError):  # turned away, or dropped for a line that is too long
            for piece in pieces:
                writer.write(piece)
                await writer.drain()
                await asyncio.sleep(0)
            if not stays:
                return ["left"]
            writer.write_eof()
            replies = [_word(line) async for line in reader]
            lines = b"".join(pieces).split(b"\n")
            if not any("limit" in each or "dropped" in each or "at most" in each for each in replies):
                assert len(replies) == len(lines) - (lines[-1] == b""), (replies, lines)
            return replies
    finally:
        writer.transport.abort()
    return ["lost"]


def _word(line: bytes) -> str:
    reply = json.loads(line)
    assert isinstance(reply, dict) and reply["ok"] in (True, False)
    return "ok" if reply["ok"] else shape(str(reply["why"]))


SERVER = Target(
    "server",
    CLIENTS,
    _served,
    quick=20,
)  # fmt: skip


# -- the client ------------------------------------------------------------------------------------------------------

REPLIES = [{"ok": True, "mode": "disarmed"}, {"ok": False, "why": "arm first"}]


class HostileServer:
    """Listens at a path, and says ``reply`` to each who asks, then hangs up; ``rude`` reads nothing before."""

    def __init__(self, path: Path) -> None:
        self.reply, self.rude = b"", False
        self._listening = socket.socket(socket.AF_UNIX)
        self._listening.bind(str(path))
        self._listening.listen()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self._thread.join()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._listening.accept()
            except OSError:
                return
            with connection, suppress(OSError):
                if not self.rude:
                    connection.recv(REQUEST_BYTES)
                connection.sendall(self.reply)


@contextmanager
def _asked() -> Iterator[Try]:
    with tempfile.TemporaryDirectory(prefix="wf-") as folder:
        path = Path(folder) / "control.sock"
        server = HostileServer(path)

        def attempt(case: tuple[bytes, bool]) -> str:
            server.reply, server.rude = case
            return reading(lambda: f"{sorted(map(shape, ask({'do': 'status'}, path, timeout_s=LONG_S)))[:2]}")

        yield attempt
        server.close()


CLIENT = Target(
    "client",
    st.tuples(
        bytes_of([ok_reply({"mode": "disarmed"}), ok_reply({"log": "x" * 60_000})], [b'"ok"', b"true", b'"why"'])
        | json_of(REPLIES, 3).map(lambda reply: as_json(reply) + b"\n"),
        st.booleans(),
    ),
    _asked,
)
