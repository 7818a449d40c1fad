"""Server of the control socket: it serves requests without delaying the control tick.

All that clients can use up is bounded: how many are connected, the length of a line, how long one may leave its answer
unread. All read into one small buffer. Requests are answered on the loop itself, but only one in each turn of the loop,
so that many requests cannot delay the tick. Every error in a request becomes a refusal, and the server continues.

A new client always gets in, so a ``stop`` does: if all places are taken, the client that came first loses its place. It
is silent, has sent half a line, does not read, or can ask again. Accepting a client takes a turn of the loop, as
answering does. So a request that is there is answered before its client can be pushed out, however many others come.
An arming that is under way for a client that has gone, or is pushed out, is given up. While all places are taken, a
client is closed after one answer, so that a few that never cease to ask cannot keep a ``stop`` waiting for long.

It works on sockets, without asyncio's streams: those read into 256 KiB, which are not there if memory is short.
"""

from __future__ import annotations

import asyncio
import socket
from collections import deque
from collections.abc import Callable, Coroutine
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from wayfarer.daemon.socket.paths import has_gone
from wayfarer.daemon.socket.protocol import (
    REQUEST_BYTES,
    STARTING,
    STOPPING,
    Commands,
    Request,
    check,
    error_reply,
    ok_reply,
    perform,
    read_line,
)
from wayfarer.errors import BadInput, WayfarerError

CLIENTS = 16  # at once, chosen by us. The more there are, the longer a stop waits for its turn
UNREAD_S = 1.0  # for a client to read its answer; chosen by us
_QUEUE = 128  # clients that wait in the kernel to be accepted; chosen by us
_NO_FILES_S = 0.1  # until accepting is tried again, if the process has no file descriptor left for it


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
        unread_s: how long a client may leave its answer unread.

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
        unread_s: float = UNREAD_S,
    ) -> None:
        self._path = path
        self._commands = commands
        self._declination_deg = declination_deg
        self._on_error = on_error
        self._places = clients
        self.unread_s = unread_s
        self.buffer = memoryview(bytearray(REQUEST_BYTES))  # all read into it, one after the other
        self._clients: dict[_Client, None] = {}  # in the order in which they came
        self._tasks: set[asyncio.Task[None]] = set()
        self._due: deque[Callable[[], None]] = deque()
        self._handle: asyncio.Handle | None = None  # of the next turn
        self._accepting = False  # in one of the next turns
        self._again: asyncio.Handle | None = None

    async def __aenter__(self) -> Self:
        self.loop = asyncio.get_running_loop()
        self._bound = _bind(self._path)
        self._listen()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.loop.remove_reader(self._bound)
        self._bound.close()
        for handle in (self._handle, self._again):
            if handle is not None:
                handle.cancel()
        for client in list(self._clients):
            client.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    # -- turns -----------------------------------------------------------------------------------------------------

    def in_turn(self, work: Callable[[], None]) -> None:
        """Do something in a later turn of the loop, in which nothing else of this is done."""
        self._due.append(work)
        if self._handle is None:
            self._handle = self.loop.call_soon(self._work)

    def _work(self) -> None:
        self._handle = None
        work = self._due.popleft()
        try:
            work()
        finally:
            if self._due and self._handle is None:
                self._handle = self.loop.call_soon(self._work)

    # -- clients ---------------------------------------------------------------------------------------------------

    def _listen(self) -> None:
        self._again = None
        self.loop.add_reader(self._bound, self._knock)

    def _knock(self) -> None:
        """Take note that somebody waits to be accepted."""
        if not self._accepting:
            self.in_turn(self._accept)
            self._accepting = True

    def _accept(self) -> None:
        self._accepting = False
        if self._bound.fileno() < 0:
            return
        try:
            connection, _ = self._bound.accept()
            self._clients[_Client(self, connection)] = None
        except BlockingIOError:
            pass  # it has gone already
        except (OSError, MemoryError):  # too many open files: the others give theirs up, one after the other
            if self._clients:
                self._push_out()
            else:
                self.loop.remove_reader(self._bound)
                self._again = self.loop.call_later(_NO_FILES_S, self._listen)
        if len(self._clients) > self._places:
            self._push_out()

    def _push_out(self) -> None:
        """Close the client that came first."""
        first = next(iter(self._clients))
        first.refuse("too many clients: this one was here longest, connect again")

    @property
    def is_full(self) -> bool:
        """Whether all places are taken."""
        return len(self._clients) >= self._places

    def forget(self, client: _Client) -> None:
        """Let a client have gone."""
        self._clients.pop(client, None)

    def close_others(self, client: _Client) -> None:
        """Give a client the memory that all others have."""
        for other in [each for each in self._clients if each is not client]:
            other.close()

    def answer(self, client: _Client, line: bytes) -> None:
        """Carry out the request of a line, and answer it, at once or, if that takes a while, later."""
        try:
            request = check(read_line(line))
        except WayfarerError as refusal:
            client.send(error_reply(str(refusal)))
            return
        if request.do in STARTING:
            client.task = self.loop.create_task(self._answer_later(client, request), name="control request")
            self._tasks.add(client.task)
            client.task.add_done_callback(self._tasks.discard)
        else:
            try:
                reply = _at_once(self._reply_to(client, request, raises=request.do in STOPPING))
            except MemoryError:  # once more, with what the others had
                self.close_others(client)
                reply = _at_once(self._reply_to(client, request))
            client.send(reply)

    async def _answer_later(self, client: _Client, request: Request) -> None:
        reply = await self._reply_to(client, request)
        client.task = None
        client.send(reply)

    async def _reply_to(self, client: _Client, request: Request, *, raises: bool = False) -> bytes:
        try:
            return ok_reply(await perform(request, self._commands, self._declination_deg, client.is_there))
        except WayfarerError as refusal:
            return error_reply(str(refusal))
        except Exception as error:
            if raises and isinstance(error, MemoryError):
                raise
            self._on_error(error)
            text = f"{type(error).__name__}: {error}"[:200]
            return error_reply(f"an error inside wayfarer ({text}): ask for the status before you go on")


class _Client:
    """A connection: what it has sent and what it has not read yet, both bounded; one request at a time."""

    def __init__(self, server: ControlServer, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._server = server
        self._loop = server.loop
        self._connection = connection
        self._unread = bytearray()  # what it has sent and is not answered yet
        self._unsent = b""
        self._waits = False  # for its turn
        self._sends = True  # False once it has closed its side
        self._patience: asyncio.Handle | None = None  # until it is closed, if it does not read
        self.task: asyncio.Task[None] | None = None  # of a request that takes a while
        self._read_on()

    def close(self) -> None:
        """Close the connection, and give up what is under way for it; safe twice."""
        if self._connection.fileno() < 0:
            return
        self._loop.remove_reader(self._connection)
        self._loop.remove_writer(self._connection)
        self._connection.close()
        self._server.forget(self)
        if self._patience is not None:
            self._patience.cancel()
        if self.task is not None:
            self.task.cancel()

    def refuse(self, why: str) -> None:
        """Say why, and close: it fits into the kernel's buffer, so nothing waits for the client to read it."""
        if not self._unsent:
            self._push(error_reply(why))
        self.close()

    def is_there(self) -> bool:
        """Return whether who asked waits for the answer."""
        return self._connection.fileno() >= 0 and not has_gone(self._connection)

    # -- what it sends ---------------------------------------------------------------------------------------------

    def _read_on(self) -> None:
        if self._sends:
            self._loop.add_reader(self._connection, self._read)

    def _read(self) -> None:
        try:
            count = self._connection.recv_into(self._server.buffer)
        except BlockingIOError:
            return
        except OSError:
            count = 0
        try:
            self._unread += self._server.buffer[:count]
        except MemoryError:  # once more, with what the others had
            self._server.close_others(self)
            self._unread += self._server.buffer[:count]
        if not count:
            self._sends = False
            if self.task is not None:  # who does not wait for the answer has gone
                self.close()
        if not count or len(self._unread) > REQUEST_BYTES:  # what is there is answered first
            self._loop.remove_reader(self._connection)
        self._go_on()

    def _go_on(self) -> None:
        """Have the next line answered in its turn, if there is one and nothing is under way."""
        if self._waits or self._unsent or self.task is not None or self._connection.fileno() < 0:
            return
        if self._unread.find(b"\n", 0, REQUEST_BYTES + 1) >= 0:
            self._waits = True
            self._server.in_turn(self._answer)
        elif len(self._unread) > REQUEST_BYTES:
            self.refuse(f"a line has {REQUEST_BYTES} bytes at most: the connection is closed")
        elif not self._sends and self._unread:
            self.refuse("the line does not end: send an end of line after each request")
        elif not self._sends:
            self.close()

    def _answer(self) -> None:
        self._waits = False
        if self._connection.fileno() < 0:
            return
        line, _, _ = self._unread.partition(b"\n")
        del self._unread[: len(line) + 1]
        self._read_on()
        self._server.answer(self, bytes(line))

    # -- what it is sent -------------------------------------------------------------------------------------------

    def send(self, reply: bytes) -> None:
        """Send an answer, at once if the client reads, and go on with the next line."""
        if self._connection.fileno() < 0:
            return
        self._push(reply)
        if self._unsent:
            self._loop.add_writer(self._connection, self._send_more)
            self._patience = self._loop.call_later(self._server.unread_s, self.close)
        else:
            self._sent()

    def _send_more(self) -> None:
        self._push(self._unsent)
        if not self._unsent:
            self._loop.remove_writer(self._connection)
            if self._patience is not None:
                self._patience.cancel()
            self._sent()

    def _push(self, reply: bytes) -> None:
        try:
            self._unsent = reply[self._connection.send(reply) :]
        except BlockingIOError:
            self._unsent = reply
        except OSError:  # it went away: what it has asked for before that is still done
            self._unsent = b""

    def _sent(self) -> None:
        if self._server.is_full:
            self.close()
        else:
            self._go_on()


def _at_once(answering: Coroutine[Any, Any, bytes]) -> bytes:
    """Return what a coroutine returns that does not wait; it takes no task, nor the memory of one."""
    try:
        answering.send(None)
    except StopIteration as done:
        reply: bytes = done.value
        return reply
    answering.close()
    raise RuntimeError("only what starts the wheels may wait for something")


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
