"""Server of the control socket: it serves requests without delaying the control tick.

All resources of clients are bounded: connections, length of a line, time to finish one, time to read the reply.
Requests are answered on the loop itself, but only one in each turn of the loop, so that many requests cannot delay the
tick. Every error in a request becomes a refusal, and the server continues.

A ``stop`` is always accepted. New clients wait in the kernel's queue, in the order of arrival. Accepting a client takes
a turn, as answering does, so that waiting requests are answered before the next client is accepted. If all connections
are in use, the client that has been without a complete request for longest is disconnected: it is idle, has sent half a
line, or does not read. A new client stays until 15 more have been accepted, which takes longer than its request.
"""

from __future__ import annotations

import asyncio
import os
import socket
from asyncio import IncompleteReadError, LimitOverrunError, StreamReader, StreamWriter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from wayfarer.daemon.socket.peer import peer_uid
from wayfarer.daemon.socket.protocol import (
    REQUEST_BYTES,
    Commands,
    Refused,
    check,
    error_reply,
    ok_reply,
    perform,
    read_line,
)
from wayfarer.errors import BadInput, WayfarerError

_QUEUE = 128
_NO_FILES_S = 0.1  # until accepting is tried again, where the process has no file descriptor left for it


class SocketLimits(NamedTuple):
    """Limits for one client, and for all together; field.md, fault 50."""

    line_bytes: int = REQUEST_BYTES
    clients: int = 16
    line_s: float = 5.0  # to finish a line once it has begun
    idle_s: float = 60.0  # between lines
    reply_s: float = 5.0  # to read a reply


LIMITS = SocketLimits()


class ControlServer:
    """Serves ``commands`` on a socket while it is entered (``async with``).

    Only the daemon's user may use the file (mode 0600), and a client must also be that user or root. The process must
    hold ``paths.single_daemon`` for the same path, which also removes the socket of a dead daemon.

    Args:
        path: where the socket is made; a Unix socket's path has 107 bytes at most.
        commands: what the daemon can do.
        declination_deg: of magnetic from true north, east positive; None where it is not configured.
        on_error: is called with every error that is not meant for the client, a bug. It must not raise.
        limits: the resources that clients may use.

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
        limits: SocketLimits = LIMITS,
    ) -> None:
        self._path = path
        self._commands = commands
        self._declination_deg = declination_deg
        self._on_error = on_error
        self._limits = limits
        self._clients: dict[asyncio.Task[None], StreamWriter] = {}  # the one who was silent longest comes first
        self._under_way: set[asyncio.Task[None]] = set()  # whose request is being done
        self._turn = asyncio.Lock()

    async def __aenter__(self) -> Self:
        self._bound = _bind(self._path)
        self._accepting = asyncio.create_task(self._accept_all(), name="control socket")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        clients = dict(self._clients)
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
                self._serve_or_reject(
                    *await asyncio.open_unix_connection(sock=connection, limit=self._limits.line_bytes - 1)
                )
            await self._take_turn()

    async def _take_turn(self) -> None:
        """Wait for the turns of those who came before, and let the other tasks of the loop run first."""
        async with self._turn:
            await asyncio.sleep(0)

    def _serve_or_reject(self, reader: StreamReader, writer: StreamWriter) -> None:
        """Begin to serve a new client, or reject it."""
        try:
            self._admit(writer)
        except Refused as refusal:
            _reject(writer, refusal)
            return
        talk = asyncio.create_task(self._serve(reader, writer), name="control client")
        self._clients[talk] = writer
        talk.add_done_callback(self._forget)

    def _forget(self, talk: asyncio.Task[None]) -> None:
        self._clients.pop(talk, None)
        self._under_way.discard(talk)

    def _admit(self, writer: StreamWriter) -> None:
        user = peer_uid(writer.get_extra_info("socket"))
        if user not in {os.geteuid(), 0}:
            raise Refused(
                f"this daemon accepts requests from user {os.geteuid()} and root only, not user {user}: use sudo"
            )
        if len(self._clients) >= self._limits.clients:
            self._make_room()

    def _make_room(self) -> None:
        """Drop the client that was silent longest; a request that is being carried out is completed."""
        silent = next((talk for talk in self._clients if talk not in self._under_way), None)
        if silent is None:
            raise Refused(f"{len(self._clients)} clients are being answered, which is the limit: try again")
        _reject(
            self._clients.pop(silent),
            Refused("disconnected to make room for another client, as the one silent longest: connect again"),
        )
        silent.cancel()

    async def _serve(self, reader: StreamReader, writer: StreamWriter) -> None:
        writer.transport.set_write_buffer_limits(0)  # drain() then waits until nothing is left here
        try:
            await self._answer_all(reader, writer)
        except OSError:
            pass  # the client went away, or would not read
        except Exception as error:
            self._on_error(error)
        finally:
            writer.transport.abort()  # close() would wait for a client that does not read

    async def _answer_all(self, reader: StreamReader, writer: StreamWriter) -> None:
        try:
            while line := await self._next_line(reader):
                await self._send(writer, await self._answer_in_turn(line))
        except Refused as refusal:
            await self._send(writer, error_reply(str(refusal)))

    async def _answer_in_turn(self, line: bytes) -> bytes:
        talk = asyncio.current_task()
        assert talk is not None
        self._clients[talk] = self._clients.pop(talk)  # now it is the last to make room
        await self._take_turn()
        self._under_way.add(talk)
        try:
            return await self._answer(line)
        finally:
            self._under_way.discard(talk)

    async def _next_line(self, reader: StreamReader) -> bytes:
        """Return the next line with its end, or nothing if the client has closed.

        Raises:
            Refused: the line is too long, too slow or has no end; the connection cannot continue after that.
        """
        time, limits = asyncio.get_running_loop().time, self._limits
        line = b""
        try:
            async with asyncio.timeout(limits.idle_s) as deadline:
                line = await reader.read(1)
                if line in {b"", b"\n"}:
                    return line
                deadline.reschedule(time() + limits.line_s)
                return line + await reader.readuntil(b"\n")
        except TimeoutError:
            waited = f"the line did not end within {limits.line_s:g} s" if line else f"idle for {limits.idle_s:g} s"
            raise Refused(f"{waited}: the connection is closed, connect again") from None
        except LimitOverrunError:
            raise Refused(f"a line has {limits.line_bytes} bytes at most: the connection is closed") from None
        except IncompleteReadError:
            raise Refused("the line does not end: send an end of line after each request") from None

    async def _answer(self, line: bytes) -> bytes:
        try:
            return ok_reply(await perform(check(read_line(line)), self._commands, self._declination_deg))
        except WayfarerError as refusal:
            return error_reply(str(refusal))
        except Exception as error:
            self._on_error(error)
            text = f"{type(error).__name__}: {error}"[:200]
            return error_reply(f"an error inside wayfarer ({text}): ask for the status before you go on")

    async def _send(self, writer: StreamWriter, reply: bytes) -> None:
        """Send a line, at most ``reply_s`` long; both ways to fail, TimeoutError and ConnectionError, are OSErrors."""
        writer.write(reply)
        async with asyncio.timeout(self._limits.reply_s):
            await writer.drain()


def _reject(writer: StreamWriter, refusal: Refused) -> None:
    """Send a refusal and close; it fits into the kernel's buffer, so nothing has to be kept here."""
    writer.write(error_reply(str(refusal)))
    writer.close()


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
