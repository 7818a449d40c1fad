"""Many viewers, in virtual time: who is sent what, and who is let go."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from tests.virtual import virtual
from wayfarer.remote.live.model import Broadcaster, PageViewer, TooSlow, ViewerLimits

LIMITS = ViewerLimits(news=5, unseen=3, silent_s=10.0)
SNAPSHOT = {"everything": True}


class Browser:
    """Takes what it is sent; ``reads`` says whether it acknowledges."""

    def __init__(self, broadcaster: Broadcaster, *, reads: bool = True, takes_s: float = 0.0) -> None:
        self.reads = reads
        self.takes_s = takes_s
        self.messages: list[list[dict[str, Any]]] = []
        self.viewer = PageViewer(broadcaster, self.send, LIMITS.silent_s, LIMITS.unseen)
        broadcaster.viewers.add(self.viewer)
        self.following = asyncio.create_task(self.viewer.follow())

    async def send(self, text: str) -> None:
        await asyncio.sleep(self.takes_s)
        self.messages.append(json.loads(text))
        if self.reads:
            self.viewer.acknowledge(len(self.messages))

    def told(self, kind: str) -> list[Any]:
        return [piece[kind] for message in self.messages for piece in message if kind in piece]

    async def leave(self) -> None:
        self.following.cancel()
        await asyncio.gather(self.following, return_exceptions=True)


async def tell(broadcaster: Broadcaster, count: int, every_s: float = 0.1) -> None:
    """Tell a piece of news and a state each time."""
    for _ in range(count):
        broadcaster.tell({"number": broadcaster.states}, {"t": broadcaster.states})
        await asyncio.sleep(every_s)


def new_broadcaster() -> Broadcaster:
    broadcaster = Broadcaster(lambda: SNAPSHOT, LIMITS)
    broadcaster.tell({}, {"t": -1})
    return broadcaster


@virtual
async def test_viewer_gets_everything_first_and_then_each_piece_in_order() -> None:
    broadcaster = new_broadcaster()
    browser = Browser(broadcaster)
    await asyncio.sleep(0.1)
    await tell(broadcaster, 20)
    assert browser.told("snapshot") == [SNAPSHOT]
    assert [news["number"] for news in browser.told("news")] == list(range(1, 21))
    assert browser.told("state")[-1] == {"t": 20}
    await browser.leave()


@virtual
async def test_slow_viewer_misses_states_but_no_news_and_never_gets_an_old_state() -> None:
    broadcaster = new_broadcaster()
    browser = Browser(broadcaster, takes_s=0.35)
    await tell(broadcaster, 40)
    await asyncio.sleep(1.0)
    assert [news["number"] for news in browser.told("news")][-30:] == list(range(11, 41))
    states = [state["t"] for state in browser.told("state")]
    assert states == sorted(states)
    assert len(states) < 20
    assert states[-1] == 40
    await browser.leave()


@virtual
async def test_viewer_that_lacks_too_much_gets_everything_again() -> None:
    broadcaster = new_broadcaster()
    browser = Browser(broadcaster, takes_s=2.0)
    await tell(broadcaster, 40)
    await asyncio.sleep(5.0)
    assert len(browser.told("snapshot")) > 1
    assert browser.told("state")[-1] == {"t": 40}
    await browser.leave()


@virtual
async def test_little_is_under_way_to_a_viewer_that_acknowledges_nothing_and_it_is_let_go() -> None:
    broadcaster = new_broadcaster()
    browser, other = Browser(broadcaster, reads=False), Browser(broadcaster)
    loop = asyncio.get_running_loop()
    began_s = loop.time()
    telling = asyncio.create_task(tell(broadcaster, 200))
    with pytest.raises(TooSlow):
        await browser.following
    assert loop.time() - began_s == pytest.approx(LIMITS.silent_s, abs=0.5)
    assert len(browser.messages) == LIMITS.unseen
    await telling
    assert other.told("state")[-1] == {"t": 200}, "the others notice nothing"
    await other.leave()


@virtual
async def test_viewer_whose_connection_takes_nothing_is_let_go() -> None:
    broadcaster = new_broadcaster()
    browser = Browser(broadcaster, takes_s=1e6)
    with pytest.raises(TooSlow):
        await browser.following


@virtual
async def test_acknowledging_what_was_never_sent_gains_nothing() -> None:
    broadcaster = new_broadcaster()
    browser = Browser(broadcaster, reads=False)
    for nonsense in (10**9, -1, None, "3", 1.5, True):
        browser.viewer.acknowledge(nonsense)
    await tell(broadcaster, 10)
    assert len(browser.messages) <= LIMITS.unseen + 1
    await browser.leave()


@virtual
async def test_catching_up_waits_for_the_last_word() -> None:
    broadcaster = new_broadcaster()
    browser = Browser(broadcaster, takes_s=0.2)
    broadcaster.tell({"outcome": "escaped"}, {"t": 1})
    async with asyncio.timeout(5.0):
        await browser.viewer.catch_up()
    assert browser.told("state")[-1] == {"t": 1}
    await browser.leave()
