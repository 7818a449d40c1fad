"""Server of the control socket: it serves requests without delaying the control tick.

All that clients can use up is bounded: how many are connected, the length of a line, how long one may leave its answers
unread. Requests are answered on the loop itself, but only one in a millisecond, and one client is accepted in a
millisecond, so that many requests or many clients do not delay the tick or the threads of its buses.

A new client always gets in, so a ``stop`` does: if all places are taken, the client that came first loses its place. It
is silent, has sent half a line, does not read, or can ask again: it had as many milliseconds as there are places. What
stops the wheels does not wait for its turn. An arming that is under way for a client that has gone, or is pushed out,
is given up.

A ``stop`` also gets in if the process has no memory or no file descriptor left: some of each are kept for it. So this
works on sockets, without asyncio's streams: those read into 256 KiB, and make a task and a timer for each client.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections import deque
from collections.abc import Callable, Coroutine
from contextlib import suppress
from mmap import mmap
from pathlib import Path
from select import POLLOUT, POLLRDHUP, poll
from types import TracebackType
from typing import Any, Self

from wayfarer.daemon.socket import protocol
from wayfarer.daemon.socket.protocol import REQUEST_BYTES, STARTING, STOPPING, Commands, Request, error_reply, is_stop
from wayfarer.errors import BadInput, WayfarerError

CLIENTS = 16  # at once, chosen by us. The more there are, the longer a request waits for its turn
PAUSE_S = 0.001  # before each answer and after each new client: floods leave time to the tick and its bus threads
UNREAD_S = 1.0  # for a client to read its answers; chosen by us
SPARE_BYTES = 16 * 2**20  # of addresses, not of memory in use: the interpreter takes 1 MiB at once, a thread 8 MiB
_QUEUE = 16  # clients that wait in the kernel to be accepted; chosen by us, for who waits behind them


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
        unread_s: how long a client may leave its answers unread.

    Raises:
        BadInput: the socket cannot be made.
    """

    def __init__(
        self, path: Path, commands: Commands, *, declination_deg: float | None,
        on_error: Callable[[Exception], None], clients: int = CLIENTS, unread_s: float = UNREAD_S,
    ) -> None:  # fmt: skip
        self._path = path
        self._commands = commands
        self._declination_deg = declination_deg
        self._on_error = on_error
        self._places = clients
        self.unread_s = unread_s
        self.buffer = memoryview(bytearray(REQUEST_BYTES + 1))  # all read into it, one after the other
        self._clients: dict[_Client, None] = {}  # in the order in which they came
        self._tasks: set[asyncio.Task[None]] = set()
        self._due: deque[_Client] = deque()  # whose request waits for its turn
        self._pause: asyncio.Handle | None = None  # until the next client is accepted
        self._spare_file = -1
        self._spare_memory: mmap | None = None

    async def __aenter__(self) -> Self:
        self.loop = asyncio.get_running_loop()
        self._bound = _bind(self._path)
        self._keep_spares()
        self._listen()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.loop.remove_reader(self._bound)
        self._bound.close()
        if self._pause is not None:
            self._pause.cancel()
        for client in list(self._clients):
            client.close()
        self._give_spares()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    # -- what is kept for a stop -----------------------------------------------------------------------------------

    def _keep_spares(self) -> None:
        with suppress(OSError, MemoryError):
            if self._spare_file < 0:
                self._spare_file = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
            if self._spare_memory is None:
                self._spare_memory = mmap(-1, SPARE_BYTES)

    def _give_spares(self) -> None:
        if self._spare_file >= 0:
            os.close(self._spare_file)
        if self._spare_memory is not None:
            self._spare_memory.close()
        self._spare_file, self._spare_memory = -1, None

    def insist(self, work: Callable[[], None]) -> None:
        """Do something; if there is no memory, once more with what is kept. It must be such as can be done twice."""
        try:
            work()
        except MemoryError:
            self._give_spares()
            work()

    # -- turns -----------------------------------------------------------------------------------------------------

    def in_turn(self, client: _Client) -> None:
        """Answer a client in a later turn of the loop, in which no other is answered."""
        if not self._due:
            self._wait_for_turn()
        self._due.append(client)

    def _wait_for_turn(self) -> None:
        self.loop.call_later(PAUSE_S, self._answer_next)

    def _answer_next(self) -> None:
        try:
            self.insist(self._due[0].answer)
        finally:
            self._due.popleft()
            if self._due:
                self.insist(self._wait_for_turn)

    # -- clients ---------------------------------------------------------------------------------------------------

    def _listen(self) -> None:
        self.loop.add_reader(self._bound, self.insist, self._accept)

    def _accept(self) -> None:
        """Accept one client, in the place of the one that came first if there is no place, descriptor or memory."""
        self._pause = self.loop.call_later(PAUSE_S, self.insist, self._listen)  # first: without it, nobody is accepted
        self.loop.remove_reader(self._bound)
        try:
            connection, _ = self._bound.accept()
            self.insist(lambda: self._clients.setdefault(_Client(self, connection)))
        except BlockingIOError:
            pass  # it has gone already
        except (OSError, MemoryError):
            if self._clients:
                self._push_out()
            else:
                self._give_spares()
        if len(self._clients) > self._places:
            self._push_out()

    def _push_out(self) -> None:
        first = next(iter(self._clients))
        first.answer()
        first.close("too many clients: this one was here longest, connect again")

    def forget(self, client: _Client) -> None:
        """Let a client have gone."""
        self._clients.pop(client, None)
        self._keep_spares()

    def answer(self, client: _Client, line: bytes) -> bytes | None:
        """Carry out the request of a line, and return the answer; None if that takes a while and is sent later.

        Raises:
            MemoryError: a stop finds no memory, and has to be tried again.
        """
        try:
            request = protocol.check(protocol.read_line(line))
        except WayfarerError as refusal:
            return error_reply(str(refusal))
        if request.do not in STARTING:
            return _at_once(self._reply_to(client, request))
        client.task = self.loop.create_task(self._answer_later(client, request), name="control request")
        self._tasks.add(client.task)
        client.task.add_done_callback(self._tasks.discard)
        return None

    async def _answer_later(self, client: _Client, request: Request) -> None:
        reply = await self._reply_to(client, request)
        client.task = None
        client.send(reply)

    async def _reply_to(self, client: _Client, request: Request) -> bytes:
        try:
            return protocol.ok_reply(
                await protocol.perform(request, self._commands, self._declination_deg, client.is_there)
            )
        except WayfarerError as refusal:
            return error_reply(str(refusal))
        except Exception as error:
            if isinstance(error, MemoryError) and request.do in STOPPING and self._spare_memory is not None:
                raise
            self._on_error(error)
            text = f"{type(error).__name__}: {error}"[:200]
            return error_reply(f"an error inside wayfarer ({text}): ask for the status before you go on")


class _Client:
    """A connection. It is read until a whole line is there, which is answered when the client has room for an answer.

    So an answer goes into the kernel's buffer in one piece, no timer is needed, and nothing is kept for a client but
    what it has sent.
    """

    def __init__(self, server: ControlServer, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._server = server
        self._loop = server.loop
        self._connection = connection
        self._unread = b""  # what it has sent and is not answered yet
        self._since_s = 0.0  # when the next line was to be answered
        self.task: asyncio.Task[None] | None = None  # of a request that takes a while
        self._loop.add_reader(connection, server.insist, self._read)

    def close(self, why: str = "") -> None:
        """Close the connection, say why if there is room for that, and give up what is under way; safe twice."""
        if self._connection.fileno() < 0:
            return
        if why:
            with suppress(OSError):
                self._connection.send(error_reply(why))
        self._loop.remove_reader(self._connection)
        self._connection.close()
        if self.task is not None:
            self.task.cancel()
        self._server.forget(self)

    def is_there(self) -> bool:
        """Return whether who asked waits for the answer."""
        return self._connection.fileno() >= 0 and not has_gone(self._connection)

    def _read(self) -> None:
        """Take what has come: only a look takes it, and it is removed once it is kept, so this can be done again."""
        buffer = self._server.buffer[: len(self._server.buffer) - len(self._unread)]
        try:
            count = self._connection.recv_into(buffer, 0, socket.MSG_PEEK)
        except BlockingIOError:  # it was taken before memory ran out
            self._go_on()
            return
        except OSError:
            count = 0
        self._unread += buffer[:count]
        if count:
            self._connection.recv_into(buffer, count)
            self._go_on()
        else:  # who does not wait for the answer has gone
            half = bool(self._unread) and self.task is None
            self.close("the line does not end: send an end of line after each request" if half else "")

    def _go_on(self) -> None:
        """Have the next line answered, a stop at once and all else in its turn; read on if there is none."""
        line, end, _ = self._unread.partition(b"\n")
        if not end and len(line) > REQUEST_BYTES:
            self.close(f"a line has {REQUEST_BYTES} bytes at most: the connection is closed")
        elif end and self.task is None:
            self._loop.remove_reader(self._connection)
            self._since_s = self._loop.time()
            if is_stop(line):
                self._loop.call_soon(self._server.insist, self.answer)
            else:
                self._server.in_turn(self)
        elif len(self._unread) > REQUEST_BYTES:  # while it waits for an answer
            self._loop.remove_reader(self._connection)
        else:
            self._loop.add_reader(self._connection, self._server.insist, self._read)

    def answer(self) -> None:
        """Answer the next line, if there is one and nothing is under way.

        If the client has no room for the answer, that is tried again until it has not read for too long.
        """
        line, end, rest = self._unread.partition(b"\n")
        if self._connection.fileno() < 0 or not end or self.task is not None:
            return
        if _is_ready(self._connection, POLLOUT) or is_stop(line):
            reply = self._server.answer(self, line)
            self._unread = rest
            if reply is None:
                self._go_on()
            else:
                self.send(reply)
        elif self._loop.time() - self._since_s < self._server.unread_s:
            self._server.in_turn(self)
        else:
            self.close()

    def send(self, reply: bytes) -> None:
        """Send an answer, and go on with the next line: also of a client that has gone, which may be a stop."""
        if self._connection.fileno() < 0:
            return
        try:
            is_whole = self._connection.send(reply) == len(reply)
        except ConnectionError:
            is_whole = True
        except OSError:  # a stop of a client that does not read
            is_whole = False
        if is_whole:
            self._go_on()
        else:
            self.close()


def has_gone(connection: Any) -> bool:
    """Return whether who is at the other end has closed its side, also if what it sent before was not read yet.

    ``connection`` is an open socket, or what an asyncio transport gives for it.
    """
    return _is_ready(connection, POLLRDHUP)


def _is_ready(connection: Any, event: int) -> bool:
    polling = poll()
    polling.register(connection, event)
    return bool(polling.poll(0))


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
