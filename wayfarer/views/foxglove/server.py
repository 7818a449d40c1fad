"""The process that shows a run to Foxglove: records in, as lines of JSON at its stdin; the SDK's server out.

``live`` starts it. It is another process than the daemon because the SDK's server (0.30) bounds nothing: it keeps
every connection for as long as the client likes, waits for all of them when it is stopped, and takes messages of 64
MB. What clients can use up, they use up here: descriptors, memory and the time of a processor.
"""

from __future__ import annotations

import os
import resource
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import orjson
from foxglove import Context, start_server
from foxglove.websocket import Capability, ChannelView, Client, ServerListener, WebSocketServer

from wayfarer.errors import BadInput
from wayfarer.fieldlog.schema import Record
from wayfarer.views.export.wall_time import nanoseconds
from wayfarer.views.foxglove import HOST
from wayfarer.views.foxglove.channels import Channels

LASTING_EVERY_S = 0.5  # so that viewers who come and go all the time cost no more than that
CONNECTIONS = 32
SWEEP_S = 0.25
DESCRIPTORS = 256  # for connections that come between two sweeps, and some 20 of the process itself
MEMORY_BYTES = 128 << 20  # four times what a run with a viewer takes, and little of what a Pi gives the service
NICENESS = 10  # the daemon's tick comes first
FAREWELL_S = 0.2  # for viewers to be told of the end; a client that says nothing would be waited for without end
IN_USE = "Address already in use"


class FoxgloveServer:
    """Sends records to viewers. Its threads send, so a slow viewer loses messages and delays nothing.

    Viewers cannot send anything to the rover. They are sent the rover's time as well: its clock may be hours off in the
    field, and Foxglove would not draw poses from its own future.

    Args:
        port: 0 takes a free one.

    Raises:
        BadInput: it cannot listen there; the text says why.
    """

    def __init__(self, port: int) -> None:
        self._context = context = Context()  # kept: the SDK takes the channels down with it
        self._channels = Channels(context)
        self._viewers = _Viewers()
        self._lasting_s = float("-inf")
        try:
            self._server = self._start(port)
        except RuntimeError as error:  # the SDK has no error class for it
            raise BadInput(_refusal(port, str(error))) from None
        self.port = self._server.port

    def show(self, record: Record) -> None:
        """Send a record to all viewers."""
        t_s, time_s = record["t_s"], record["t_wall"]
        self._server.broadcast_time(nanoseconds(time_s))
        self._channels.take(record, time_s)
        if self._viewers.changed and t_s >= self._lasting_s + LASTING_EVERY_S:
            self._viewers.changed = False
            self._lasting_s = t_s
            self._channels.send_lasting(time_s)

    def sweep(self) -> None:
        """Close all connections where there are more than ``CONNECTIONS``, and listen again where the SDK has ceased.

        It ceases at the first connection that it cannot accept. Viewers connect again by themselves.
        """
        listens, connections = self._sockets()
        if len(connections) > CONNECTIONS:
            for descriptor in connections:
                with suppress(OSError), _borrowed(descriptor) as connection:  # it may be gone
                    connection.shutdown(socket.SHUT_RDWR)
        if not listens:
            with suppress(RuntimeError):  # until there are descriptors again
                self._server = self._start(self.port)

    def stop(self) -> None:
        """End; waits for the clients."""
        self._server.stop()

    def _start(self, port: int) -> WebSocketServer:
        return start_server(
            name="wayfarer",
            host=HOST,
            port=port,
            context=self._context,
            server_listener=self._viewers,
            capabilities=[Capability.Time],
        )

    def _sockets(self) -> tuple[bool, list[int]]:
        """Return whether anything listens on the port, and the descriptors of its connections.

        The SDK tells nothing of clients before their handshake. To list descriptors would take one more.
        """
        listens, connections = False, []
        for descriptor in range(DESCRIPTORS):
            with suppress(OSError), _borrowed(descriptor) as found:  # nothing is open there, or it is no socket
                if found.getsockname() == (HOST, self.port):
                    if found.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                        listens = True
                    else:
                        connections.append(descriptor)
        return listens, connections


class _Viewers(ServerListener):
    """Notes that a viewer began to look at a channel; called by the server's threads."""

    changed = False

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        """Note it: what was sent long ago must be sent again."""
        self.changed = True


@contextmanager
def _borrowed(descriptor: int) -> Iterator[socket.socket]:
    """Give a socket of the SDK's, which stays open."""
    found = socket.socket(socket.AF_INET, socket.SOCK_STREAM, fileno=descriptor)
    try:
        yield found
    finally:
        found.detach()


def _refusal(port: int, error: str) -> str:
    if IN_USE in error:
        return f"port {port} on {HOST} is in use; see what has it with ss -ltnp, or choose another with --foxglove-port"
    return f"Foxglove cannot be served at {HOST} port {port}: {error.rpartition('FoxgloveError: ')[2]}"


def _limit(what: int, most: int) -> None:
    _, hard = resource.getrlimit(what)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(what, (most, most))


def _sweep_regularly(server: FoxgloveServer) -> None:
    never = Event()
    while not never.wait(SWEEP_S):
        server.sweep()


def main() -> None:
    """Serve at a port, until stdin ends; say at stdout which port it is, or why it cannot be had."""
    _limit(resource.RLIMIT_NOFILE, DESCRIPTORS)
    _limit(resource.RLIMIT_DATA, MEMORY_BYTES)
    os.nice(NICENESS)
    with suppress(OSError):  # if memory runs out, this process goes and not the daemon
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    try:
        server = FoxgloveServer(int(sys.argv[1]))
    except BadInput as refusal:
        print(refusal, flush=True)
        return
    print(server.port, flush=True)
    Thread(target=_sweep_regularly, args=[server], daemon=True).start()
    for line in sys.stdin.buffer:
        if line.endswith(b"\n"):  # the last one may be cut off
            server.show(orjson.loads(line))
    stopping = Thread(target=server.stop, daemon=True)
    stopping.start()
    stopping.join(FAREWELL_S)
    os._exit(0)  # no thread is waited for


if __name__ == "__main__":
    main()
