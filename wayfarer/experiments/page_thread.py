"""The live page of a demo in its own thread, where time is real: the rover's may run fast, or stand still."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from threading import Thread
from types import TracebackType
from typing import TYPE_CHECKING, Any

from wayfarer.daemon.socket.protocol import Commands

if TYPE_CHECKING:
    from wayfarer.views.live.server import LivePage


class PageThread:
    """Serves a page while entered, over as many runs as there are.

    Args:
        page: the page; from now on only its own thread touches it.
        commands: what viewers may ask of a run; called in that thread.
    """

    def __init__(self, page: LivePage, commands: Commands) -> None:
        self.page = page
        self._commands = commands
        self._serving: Future[asyncio.AbstractEventLoop] = Future()
        self._thread = Thread(target=asyncio.run, args=[self._serve()], name="live page", daemon=True)

    def __enter__(self) -> None:
        """Begin to serve."""
        self._thread.start()
        self._loop = self._serving.result()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Send the last news and end."""
        self.call(self._over.set)
        self._thread.join()

    def call(self, function: Callable[..., object], *arguments: Any) -> None:
        """Have the page's thread call a function soon, in the order of these calls."""
        self._loop.call_soon_threadsafe(function, *arguments)

    async def _serve(self) -> None:
        self._over = asyncio.Event()
        try:
            async with self.page.serving(self._commands):
                self._serving.set_result(asyncio.get_running_loop())
                await self._over.wait()
        except BaseException as error:
            if self._serving.done():
                raise
            self._serving.set_exception(error)
