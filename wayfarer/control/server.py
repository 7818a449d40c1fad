"""The daemon's end of the control socket: it serves requests beside the control tick, and never at its cost.

Everything that a client can use up is bounded: connections, length of a line, time to finish one, time to read the
reply. Where all connections are taken, the one that has been idle longest makes room: whoever forgot to close theirs
keeps no ``stop`` out. Requests are answered on the loop itself, but only one in each turn of the loop, so that a flood
waits for the tick and not the tick for the flood. Whatever goes wrong in a request ends as a refusal; the server goes
on.
"""

from __future__ import annotations

import asyncio
import os
import socket
import struct
from asyncio import IncompleteReadError, LimitOverrunError, StreamReader, StreamWriter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from wayfarer.control.protocol import REQUEST_BYTES, Commands, Refused, accept, check, perform, read_line, refuse
from wayfarer.errors import BadInput, WayfarerError

_CREDENTIALS = struct.Struct("iII")  # struct ucred of unix(7): process, user and group
_ACCEPTED_A_TURN = 2  # what asyncio takes for the length of the queue, it also accepts in one turn of the loop
_QUEUE = 128


class Limits(NamedTuple):
    """What one client, and all of them, may use up; field.md, fault 50."""

    line_bytes: int = REQUEST_BYTES
    clients: int = 16
    line_s: float = 5.0  # to finish a line once it has begun
    idle_s: float = 60.0  # between lines
    reply_s: float = 5.0  # to read a reply


LIMITS = Limits()


class ControlServer:
    """Serves ``commands`` on a socket while it is entered (``async with``).

    The file is the daemon's alone (mode 0600), and a peer must be its user or root besides. The process must hold
    ``paths.SingleDaemon`` for the same path, which also clears a dead daemon's socket away.

    Args:
        path: where the socket is made; a Unix socket's path has 107 bytes at most.
        commands: what the daemon can do.
        declination_deg: of magnetic from true north, east positive; None where it is not configured.
        on_error: is told of every error that is not meant for the client: a bug. It must not raise.
        limits: what clients may use up.

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
        limits: Limits = LIMITS,
    ) -> None:
        self._path = path
        self._commands = commands
        self._declination_deg = declination_deg
        self._on_error = on_error
        self._limits = limits
        self._talks: set[asyncio.Task[None]] = set()
        self._idle: dict[asyncio.Task[None], StreamWriter] = {}  # the longest comes first
        self._turn = asyncio.Lock()

    async def __aenter__(self) -> Self:
        bound = _bind(self._path)
        self._server = await asyncio.start_unix_server(
            self._meet, sock=bound, backlog=_ACCEPTED_A_TURN, limit=self._limits.line_bytes - 1
        )
        bound.listen(_QUEUE)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._server.close()
        for talk in self._talks:
            talk.cancel()
        await asyncio.gather(*self._talks, return_exceptions=True)
        await self._server.wait_closed()

    def _meet(self, reader: StreamReader, writer: StreamWriter) -> None:
        """Begin to talk with a new client, or turn it away."""
        try:
            self._admit(writer)
        except Refused as refusal:
            _turn_away(writer, refusal)
            return
        talk = asyncio.get_running_loop().create_task(self._talk(reader, writer), name="control client")
        self._talks.add(talk)
        talk.add_done_callback(self._talks.discard)

    def _admit(self, writer: StreamWriter) -> None:
        user = peer_uid(writer.get_extra_info("socket"))
        if user not in {os.geteuid(), 0}:
            raise Refused(f"this daemon obeys user {os.geteuid()} and root only, not user {user}: use sudo")
        if len(self._talks) >= self._limits.clients:
            self._make_room()

    def _make_room(self) -> None:
        """Drop the client that has been idle longest."""
        if not self._idle:
            raise Refused(f"{len(self._talks)} clients are being answered, which is the limit: try again")
        talk = next(iter(self._idle))
        _turn_away(self._idle.pop(talk), Refused("dropped for another client, as the one idle longest: connect again"))
        talk.cancel()

    async def _talk(self, reader: StreamReader, writer: StreamWriter) -> None:
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
            while line := await self._next_line(reader, writer):
                async with self._turn:  # clients take turns, and each lets the rest of the loop go first
                    await asyncio.sleep(0)
                await self._send(writer, await self._answer(line))
        except Refused as refusal:
            await self._send(writer, refuse(str(refusal)))

    async def _next_line(self, reader: StreamReader, writer: StreamWriter) -> bytes:
        """Return the next line with its end, or nothing if the client has closed.

        Raises:
            Refused: the line is too long, too slow or has no end; there is no going on after that.
        """
        time, limits = asyncio.get_running_loop().time, self._limits
        line = b""
        try:
            async with asyncio.timeout(limits.idle_s) as deadline:
                with self._idling(writer):
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

    @contextmanager
    def _idling(self, writer: StreamWriter) -> Iterator[None]:
        """Mark the client of this task as one that nothing is done for."""
        talk = asyncio.current_task()
        assert talk is not None
        self._idle[talk] = writer
        try:
            yield
        finally:
            self._idle.pop(talk, None)

    async def _answer(self, line: bytes) -> bytes:
        try:
            return accept(await perform(check(read_line(line)), self._commands, self._declination_deg))
        except WayfarerError as refusal:
            return refuse(str(refusal))
        except Exception as error:
            self._on_error(error)
            text = f"{type(error).__name__}: {error}"[:200]
            return refuse(f"an error inside wayfarer ({text}): ask for the status before you go on")

    async def _send(self, writer: StreamWriter, reply: bytes) -> None:
        """Send a line, at most ``reply_s`` long; both ways to fail, TimeoutError and ConnectionError, are OSErrors."""
        writer.write(reply)
        async with asyncio.timeout(self._limits.reply_s):
            await writer.drain()


def _turn_away(writer: StreamWriter, refusal: Refused) -> None:
    """Say no and close; it fits what the kernel buffers, so nothing stays here."""
    writer.write(refuse(str(refusal)))
    writer.close()


def peer_uid(connection: Any) -> int:
    """Return the user at the other end of a Unix socket, as the kernel noted it at connecting."""
    _, user, _ = _CREDENTIALS.unpack(connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
    return int(user)


def _bind(path: Path) -> socket.socket:
    """Return a socket at a path that nobody else can connect to: it gets its mode before it listens."""
    bound = socket.socket(socket.AF_UNIX)
    try:
        bound.bind(str(path))
        path.chmod(0o600)
    except OSError as error:
        bound.close()
        raise BadInput(f"{path}: the control socket cannot be made: {error.strerror or error}") from None
    return bound
