"""Sends a run to many viewers; a slow viewer delays neither another one nor the rover.

No viewer has a queue. All share one short list of news and the newest state, and each viewer has a position in that
list. It is sent what it lacks once it has acknowledged earlier messages. So a viewer with a slow connection gets every
piece of news but fewer states, and never an old state. One that lacks more than the list holds gets everything again.
One that acknowledges nothing is dropped.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple

import msgspec

from wayfarer.control.rate import ASKED_AT_ONCE, ASKED_HZ


class ViewerLimits(NamedTuple):
    """Bounds on what viewers use; seconds of the wall clock."""

    viewers: int = 16
    connections: int = 32  # viewers, and clients that are only being served the page
    handshake_s: float = 10.0  # from the connection to the end of the handshake
    message_bytes: int = 8_192
    news: int = 300  # half a minute at the full rate
    unseen: int = 3  # messages under way to one viewer
    old_s: float = 1.0  # what a page shows that is older must start no wheels; as OLD_S of the page
    requests: int = ASKED_AT_ONCE  # of one viewer, but for those that stop the wheels: each is written into the log
    requests_hz: float = ASKED_HZ
    silent_s: float = 10.0  # until a viewer that acknowledges nothing is dropped
    end_s: float = 0.3  # for the last messages: a run must end within 2 s


LIMITS = ViewerLimits()

Send = Callable[[str], Awaitable[None]]


class TooSlow(Exception):
    """A viewer has acknowledged nothing for too long."""


class Broadcaster:
    """News and states for all viewers; each is encoded once.

    Args:
        snapshot: returns everything that a new viewer needs; it may call ``tell``.
        limits: bounds on what viewers use.
    """

    def __init__(self, snapshot: Callable[[], Any], limits: ViewerLimits) -> None:
        self._snapshot = snapshot
        self._news: deque[str] = deque(maxlen=limits.news)
        self.viewers: set[PageViewer] = set()
        self.pieces = 0  # of news, so far
        self.states = 0
        self.state = ""

    def tell(self, news: dict[str, Any], state: dict[str, Any]) -> None:
        """Send to all viewers; ``news`` may be empty."""
        if news:
            self._news.append(_encoded(news=news))
            self.pieces += 1
        self.state = _encoded(state=state)
        self.states += 1
        for viewer in self.viewers:
            viewer.wake()

    def since(self, pieces: int | None) -> list[str]:
        """Return the news after the first ``pieces`` of it, or a snapshot if that is not possible."""
        if pieces is not None and self.pieces - pieces <= len(self._news):
            return list(self._news)[len(self._news) - (self.pieces - pieces) :]
        return [_encoded(snapshot=self._snapshot())]


class PageViewer:
    """One viewer, and how much it has been sent.

    Args:
        broadcaster: where news and states come from.
        send: sends it a text; waits while the connection is full.
        silent_s: how long it may acknowledge nothing, in seconds of the loop.
        unseen: how many messages may be under way.
    """

    def __init__(self, broadcaster: Broadcaster, send: Send, silent_s: float, unseen: int) -> None:
        self._broadcaster = broadcaster
        self._send = send
        self._silent_s = silent_s
        self._unseen = unseen
        self._awake = asyncio.Event()
        self._awake.set()
        self._heard = asyncio.Event()
        self._pieces: int | None = None
        self._states = 0
        self._sent = self._seen = 0

    def wake(self) -> None:
        """Check for something new."""
        self._awake.set()

    def acknowledge(self, seen: object) -> None:
        """Take the number of messages that the page says it has seen."""
        if isinstance(seen, int) and self._seen < seen <= self._sent:
            self._seen = seen
            self._since_s = asyncio.get_running_loop().time()
            self._heard.set()
            self.wake()

    async def catch_up(self) -> None:
        """Wait until everything is acknowledged."""
        while self._states != self._broadcaster.states or self._seen != self._sent:
            self._heard.clear()
            await self._heard.wait()

    async def follow(self) -> None:
        """Send what is new, until cancelled.

        Raises:
            TooSlow: it takes nothing, or acknowledges nothing.
        """
        time = asyncio.get_running_loop().time
        self._since_s = time()
        while True:
            await self._awake.wait()
            self._awake.clear()
            if self._sent == self._seen:
                self._since_s = time()
            elif time() - self._since_s > self._silent_s:
                raise TooSlow
            if self._sent - self._seen < self._unseen and self._states != self._broadcaster.states:
                await self._send_what_is_new()

    async def _send_what_is_new(self) -> None:
        broadcaster = self._broadcaster
        pieces = broadcaster.since(self._pieces)
        self._pieces, self._states = broadcaster.pieces, broadcaster.states
        self._sent += 1
        try:
            async with asyncio.timeout(self._silent_s):
                await self._send(f"[{','.join([*pieces, broadcaster.state])}]")
        except TimeoutError:
            raise TooSlow from None


def _encoded(**piece: Any) -> str:
    return msgspec.json.encode(piece).decode()
