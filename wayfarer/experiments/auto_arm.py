"""Arms a simulated rover automatically when a viewer opens the page, for the demo.

A real rover is never armed by this. It stands beside the simulator, where no field code can find it, and arms only a
run whose own first record says that it is simulated.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import TYPE_CHECKING

from wayfarer.daemon.socket.protocol import Commands
from wayfarer.errors import WayfarerError
from wayfarer.fieldlog.schema import Record

if TYPE_CHECKING:
    from wayfarer.daemon.daemon import Viewer

GOAL_HEADING_DEG = 0.0  # generated forests are left to the north


class AutoArm:
    """A viewer around another one: it arms the run once ``watched`` is set and the rover knows its heading."""

    def __init__(self, viewer: Viewer, watched: asyncio.Event) -> None:
        self._viewer = viewer
        self._watched = watched
        self._knows_heading = asyncio.Event()
        self._simulated = False

    def show(self, record: Record) -> None:
        """Take a record; see ``Viewer``."""
        self._viewer.show(record)
        kind = record["record"]
        if kind == "run":
            self._simulated = record.get("simulated") is True
        elif kind == "tick" and record.get("heading_deg") is not None:
            self._knows_heading.set()

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:
        """Serve while entered; see ``Viewer``."""
        async with self._viewer.serving(commands):
            arming = asyncio.create_task(self._arm(commands), name="auto-arm")
            try:
                yield
            finally:
                arming.cancel()

    async def _arm(self, commands: Commands) -> None:
        await self._watched.wait()
        await self._knows_heading.wait()
        if self._simulated:
            with suppress(WayfarerError):  # the run's own log says why it was refused
                await commands.arm(GOAL_HEADING_DEG)
