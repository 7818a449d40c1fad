"""A read-only Foxglove WebSocket server for a running rover."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from foxglove import Context, start_server
from foxglove.websocket import Capability, ChannelView, Client, ServerListener

from wayfarer.daemon.socket.protocol import Commands
from wayfarer.errors import BadInput
from wayfarer.fieldlog.schema import Record
from wayfarer.views.export.wall_time import nanoseconds
from wayfarer.views.foxglove.channels import Channels

HOST = "127.0.0.1"  # anybody who can reach it can watch
LASTING_EVERY_S = 0.5  # so that viewers who come and go all the time cost no more than that
IN_USE = "Address already in use"


class FoxgloveLive:
    """Shows a run to Foxglove; implements ``daemon.viewer.Viewer``.

    The server's threads send, so a slow viewer loses messages and delays nothing. Viewers cannot send anything to the
    rover. They are sent the rover's time as well: its clock may be hours off in the field, and Foxglove would not draw
    poses from its own future.

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
            self._server = start_server(
                name="wayfarer",
                host=HOST,
                port=port,
                context=context,
                server_listener=self._viewers,
                capabilities=[Capability.Time],
            )
        except RuntimeError as error:  # the SDK has no error class for it
            raise BadInput(_refusal(port, str(error))) from None
        self.url = f"ws://{HOST}:{self._server.port}"

    def show(self, record: Record) -> None:
        """Send a record to all viewers."""
        t_s, time_s = record["t_s"], record["t_wall"]
        self._server.broadcast_time(nanoseconds(time_s))
        self._channels.take(record, time_s)
        if self._viewers.changed and t_s >= self._lasting_s + LASTING_EVERY_S:
            self._viewers.changed = False
            self._lasting_s = t_s
            self._channels.send_lasting(time_s)

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:  # noqa: ARG002
        """Stop listening in the end."""
        try:
            yield
        finally:
            self._server.stop()


class _Viewers(ServerListener):
    """Notes that a viewer began to look at a channel; called by the server's threads."""

    changed = False

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        """Note it: what was sent long ago must be sent again."""
        self.changed = True


def _refusal(port: int, error: str) -> str:
    if IN_USE in error:
        return f"port {port} on {HOST} is in use; see what has it with ss -ltnp, or choose another with --foxglove-port"
    return f"Foxglove cannot be served at {HOST} port {port}: {error.rpartition('FoxgloveError: ')[2]}"
