"""Server of the control socket: it serves requests without delaying the control tick.

All resources of clients are bounded: connections, length of a line, time to send one and to read the reply.
Requests are answered on the loop itself, but only one in each turn of the loop, so that many requests cannot delay the
tick. Every error in a request becomes a refusal, and the server continues.

A new client always gets in, so a ``stop`` does: where all places are taken, it gets that of the client that came first,
which is silent, has sent half a line, does not read, or can ask again. Accepting a client takes a turn of the loop, as
answering does. So a request that is there is answered before its client can be pushed out, however many others come.
An arming that is under way for a client that has gone, or is pushed out, is given up. While all places are taken, a
client is closed after one answer, so that a few that never cease to ask cannot keep a ``stop`` waiting for long.
"""

from __future__ import annotations

import asyncio
import socket
from asyncio import IncompleteReadError, LimitOverrunError, StreamReader, StreamReaderProtocol, StreamWriter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

from wayfarer.daemon.socket.paths import has_gone
from wayfarer.daemon.socket.protocol import (
    REQUEST_BYTES,
    STARTING,
    Commands,
    Refused,
    check,
    error_reply,
    ok_reply,
    perform,
    read_line,
)
from wayfarer.errors import BadInput, WayfarerError

CLIENTS = 16  # at once, chosen by us. The more there are, the longer a stop waits for its turn
WAIT_S = 60.0  # for a whole line, and for a client to read its reply; chosen by us
_QUEUE = 128  # clients that wait in the kernel to be accepted; chosen by us
_NO_FILES_S = 0.1  # until accepting is tried again, where the process has no file descriptor left for it


class ControlServer:
    """Serves ``commands`` on a socket while it is entered (``async with``).

    Only the daemon's user and root may use the file (mode 0600). The process must hold ``paths.single_daemon`` for the
    same path, which also removes the socket of a dead daemon.

    Args:
        path: where the socket is made; a Unix socket's path has 107 bytes at most.
        commands: what the daemon can do.
        declination_deg: of magnetic from true north, east positive; None if it is not configured.
        on_error: is called with every error that is not meant for the client, a bug. It must not raise.
        clients: how many may be connected at once.
        wait_s: how long a client may take to send a line, and to read its reply.

    Raises:
        BadInput: the socket cannot be made.
    """

    def __init__(
        self,
        path: Path,
        commands: Commands,
        *,
        declination_deg: float | None,
        on_error: Callable[[Exception], None],
        clients: int = CLIENTS,
        wait_s: float = WAIT_S,
    ) -> None:
        self._path = path
        self._commands = commands
        self._declination_deg = declination_deg
        self._on_error = on_error
        self._places = clients
        self._wait_s = wait_s
        self._clients: dict[asyncio.Task[None], StreamWriter] = {}  # in the order in which they came
        self._turn = asyncio.Lock()

    async def __aenter__(self) -> Self:
        self._bound = _bind(self._path)
        self._accepting = asyncio.create_task(self._accept_all(), name="control socket")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        clients = self._clients.copy()
        tasks = [self._accepting, *clients]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        for writer in clients.values():
            writer.transport.abort()  # of one that had not begun to talk
        self._bound.close()

    async def _accept_all(self) -> None:
        """Accept clients, at most one in each turn of the loop."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, _ = await loop.sock_accept(self._bound)
            except OSError:  # too many open files: the other clients continue, and end
                await asyncio.sleep(_NO_FILES_S)
                continue
            with suppress(OSError):  # it has gone already
                self._admit(*await _open(connection))
            await self._take_turn()

    async def _take_turn(self) -> None:
        """Wait for the turns of those who came before, and let the other tasks of the loop run first."""
        async with self._turn:
            await asyncio.sleep(0)

    def _admit(self, reader: _Client, writer: StreamWriter) -> None:
        """Begin to serve a new client, in place of the first one if there is none left."""
        new = asyncio.create_task(self._serve(reader, writer), name="control client")
        self._clients[new] = writer
        new.add_done_callback(lambda client: self._clients.pop(client, None))
        if len(self._clients) > self._places:
            first = next(iter(self._clients))
            # It fits into the kernel's buffer, so nothing waits for the client to read it.
            self._clients.pop(first).write(error_reply("too many clients: this one was here longest, connect again"))
            first.cancel()

    async def _serve(self, reader: _Client, writer: StreamWriter) -> None:
        writer.transport.set_write_buffer_limits(0)  # drain() then waits until nothing is left here
        try:
            await self._answer_all(reader, writer)
        except OSError:
            pass  # the client went away, or would not read
        except Exception as error:
            self._on_error(error)
        finally:
            writer.transport.abort()  # close() would wait for a client that does not read

    async def _answer_all(self, reader: _Client, writer: StreamWriter) -> None:
        try:
            while line := await self._next_line(reader):
                await self._take_turn()
                await self._send(writer, await self._answer(line, reader, writer))
                if len(self._clients) >= self._places:
                    return
        except Refused as refusal:
            await self._send(writer, error_reply(str(refusal)))

    async def _next_line(self, reader: StreamReader) -> bytes:
        """Return the next line with its end, or nothing if the client has closed.

        Raises:
            Refused: the line is too long, too slow or has no end; the connection cannot continue after that.
        """
        try:
            async with asyncio.timeout(self._wait_s):
                return await reader.readuntil(b"\n")
        except TimeoutError:
            raise Refused(f"no whole line within {self._wait_s:g} s: the connection is closed, connect again") from None
        except LimitOverrunError:
            raise Refused(f"a line has {REQUEST_BYTES} bytes at most: the connection is closed") from None
        except IncompleteReadError as error:
            if error.partial:
                raise Refused("the line does not end: send an end of line after each request") from None
            return b""

    async def _answer(self, line: bytes, reader: _Client, writer: StreamWriter) -> bytes:
        """Carry out the request of a line, and return the reply; a client that goes ends what would start wheels."""
        try:
            request = check(read_line(line))
            if request.do in STARTING:
                reader.gone = asyncio.current_task()
            there = partial(_is_there, writer.transport)
            return ok_reply(await perform(request, self._commands, self._declination_deg, there))
        except WayfarerError as refusal:
            return error_reply(str(refusal))
        except Exception as error:
            self._on_error(error)
            text = f"{type(error).__name__}: {error}"[:200]
            return error_reply(f"an error inside wayfarer ({text}): ask for the status before you go on")
        finally:
            reader.gone = None

    async def _send(self, writer: StreamWriter, reply: bytes) -> None:
        """Send a line, at most ``wait_s`` long; both ways to fail, TimeoutError and ConnectionError, are OSErrors."""
        writer.write(reply)
        async with asyncio.timeout(self._wait_s):
            await writer.drain()


class _Client(StreamReader):
    """What a client sends. The task ``gone`` is cancelled once it has closed its side, also while nobody reads."""

    gone: asyncio.Task[None] | None = None

    def feed_eof(self) -> None:
        """Take the end of what it sends."""
        super().feed_eof()
        self._cancel()

    def set_exception(self, exc: Exception) -> None:
        """Take the error with which it went."""
        super().set_exception(exc)
        self._cancel()

    def _cancel(self) -> None:
        if self.gone is not None:
            self.gone.cancel()


async def _open(connection: socket.socket) -> tuple[_Client, StreamWriter]:
    """Do what ``asyncio.open_unix_connection`` does, with a ``_Client``."""
    loop = asyncio.get_running_loop()
    client = _Client(REQUEST_BYTES, loop)
    protocol = StreamReaderProtocol(client, loop=loop)
    transport, _ = await loop.create_unix_connection(lambda: protocol, sock=connection)
    return client, StreamWriter(transport, protocol, client, loop)


def _is_there(transport: asyncio.BaseTransport) -> bool:
    return not has_gone(transport)


def _bind(path: Path) -> socket.socket:
    """Return a socket at a path that no other user can connect to: it gets its mode before it listens."""
    bound = socket.socket(socket.AF_UNIX)
    try:
        bound.bind(str(path))
        path.chmod(0o600)
        bound.listen(_QUEUE)
        bound.setblocking(False)
    except OSError as error:
        bound.close()
        raise BadInput(f"{path}: the control socket cannot be made: {error.strerror or error}") from None
    return bound
