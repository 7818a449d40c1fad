"""Viewers of a running rover: the interface that the live page and Foxglove implement."""

from __future__ import annotations

from contextlib import AbstractAsyncContextManager
from typing import Protocol

from wayfarer.daemon.socket.protocol import Commands
from wayfarer.fieldlog.schema import Record


class Viewer(Protocol):
    """Gets every record of the run's log, and may serve clients on the daemon's loop."""

    def show(self, record: Record) -> None:
        """Take a record as it is written, the first one before anything is open. Must not wait, nor change it."""

    def serving(self, commands: Commands) -> AbstractAsyncContextManager[None]:
        """Serve clients while entered; ``commands`` are those of the control socket."""
