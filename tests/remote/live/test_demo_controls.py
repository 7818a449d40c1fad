"""The buttons of a demo: what reaches it, and that no other run has them."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Any

from tests.remote.live.test_server import Site, first, serving
from wayfarer.remote.live import DEMO_VERBS, DemoState
from wayfarer.remote.live.model import LIMITS

REQUESTS = [{"do": verb} for verb in DEMO_VERBS if verb != "speed"] + [{"do": "speed", "times": 20}]


class Demo:
    """Keeps what it is asked; implements ``DemoControls``."""

    def __init__(self) -> None:
        self.asked: list[Any] = []
        self.is_seen = False

    def now(self) -> DemoState:
        return DemoState(seed=22, speed=6.0, paused=True, log="logs/1")

    def seen(self) -> None:
        self.is_seen = True

    def pause(self, paused: bool) -> None:
        self.asked.append(("pause", paused))

    def run_at(self, speed: float) -> None:
        self.asked.append(("speed", speed))


@contextlib.asynccontextmanager
async def demonstrated() -> AsyncIterator[tuple[Site, Demo]]:
    demo = Demo()
    async with serving(demo=demo) as site:
        yield site, demo


async def replies_to(site: Site, *requests: dict[str, Any]) -> list[dict[str, Any]]:
    replies: list[dict[str, Any]] = []
    async with site.connect() as connection:
        for request in requests:
            await connection.send_json(request)
            replies.append(await first(connection, "reply"))
    return replies


async def test_run_that_is_no_demo_refuses_them_in_words() -> None:
    async with serving() as site:
        for request, reply in zip(REQUESTS, await replies_to(site, *REQUESTS), strict=True):
            assert reply["ok"] is False, request
            assert "only for wayfarer demo" in reply["why"], request
        assert site.rover.asked == []


async def test_demo_needs_no_token_on_this_computer() -> None:
    async with demonstrated() as (site, _):
        assert "token" not in site.page.url
        async with site.connect(token="") as connection:
            assert await first(connection, "may_start") is True


async def test_demo_is_asked_for_each() -> None:
    async with demonstrated() as (site, demo):
        replies = await replies_to(site, *REQUESTS)
        assert [reply["ok"] for reply in replies] == [True] * len(DEMO_VERBS)
        assert demo.asked == [("pause", True), ("pause", False), ("speed", 20.0)]
        assert site.rover.asked == [], "no part of the rover takes part"


async def test_speed_that_cannot_be_is_refused() -> None:
    wrong: list[Any] = [None, "6", True, 0, -1, 1e9, []]
    asked = [{"do": "speed", "times": times} for times in wrong]
    async with demonstrated() as (site, demo):
        for request, reply in zip(asked, await replies_to(site, *asked), strict=True):
            assert "from 0.1 to 1000" in reply["why"], request
        assert demo.asked == []


async def test_buttons_are_not_limited_as_marks_are_because_nothing_is_written() -> None:
    async with demonstrated() as (site, demo):
        replies = await replies_to(site, *[{"do": "pause"}, {"do": "play"}] * LIMITS.requests)
        assert all(reply["ok"] for reply in replies)
        assert len(demo.asked) == 2 * LIMITS.requests


async def test_demo_is_told_that_it_is_seen_and_the_page_how_it_is() -> None:
    async with demonstrated() as (site, demo):
        async with site.connect() as connection:
            assert not demo.is_seen
            assert (await first(connection, "state"))["demo"] == {
                "seed": 22,
                "speed": 6.0,
                "paused": True,
                "log": "logs/1",
            }
            await first(connection, "state")
            assert demo.is_seen
            assert site.page.is_watched
        await asyncio.sleep(0.1)
        assert not site.page.is_watched


async def test_state_of_a_rover_says_nothing_of_a_demo() -> None:
    async with serving() as site, site.connect() as connection:
        assert "demo" not in await first(connection, "state")


async def test_old_page_of_a_demo_may_resume_because_no_wheels_turn() -> None:
    async with demonstrated() as (site, _):
        (reply,) = await replies_to(site, {"do": "resume", "asked_s": 1.0})
        assert "not held" in reply["why"], "the rover itself has answered"
