"""Viewers of a running rover: the interface that the live page and Foxglove implement."""

from __future__ import annotations

from contextlib import AbstractAsyncContextManager
from typing import Protocol

from wayfarer.daemon.socket.protocol import Commands
from wayfarer.fieldlog.schema import Record


class Viewer(Protocol):
    """Is shown every record of the run's log, and may be served on the daemon's loop."""

    def show(self, record: Record) -> None:
        """Take a record as it is written, the first one before anything is open. Must not wait, nor change it."""

    def serving(self, commands: Commands) -> AbstractAsyncContextManager[None]:
        """Serve while entered; ``commands`` is what the control socket can do, too."""
