"""A simulated rover arms itself for whoever looks on. That nothing else does: ``tests/test_imports.py``."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from tests.virtual import virtual
from wayfarer.daemon.socket.protocol import Commands
from wayfarer.experiments.auto_arm import AutoArm
from wayfarer.fieldlog.log import Record


class Rover:
    """Keeps what it is asked."""

    def __init__(self) -> None:
        self.armed: list[float | None] = []

    async def arm(self, heading_deg: float | None = None) -> dict[str, Any]:
        self.armed.append(heading_deg)
        return {}


class Page:
    """A viewer that keeps what it is shown."""

    def __init__(self) -> None:
        self.shown: list[Record] = []
        self.show = self.shown.append
        self.watched = asyncio.Event()

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:
        yield


async def armed_by(page: Page, *records: Record) -> list[float | None]:
    """Show records to a page that is watched, and return how the rover was armed."""
    viewer, rover = AutoArm(page, page.watched), Rover()
    async with viewer.serving(rover):  # type: ignore[arg-type]
        page.watched.set()
        for record in records:
            viewer.show(record)
        await asyncio.sleep(1.0)
    assert page.shown == list(records)
    return rover.armed


RUN: Record = {"record": "run", "simulated": True}
HEADING: Record = {"record": "tick", "heading_deg": 0.0}


@virtual
async def test_rover_is_armed_once_when_it_is_watched_and_knows_its_heading() -> None:
    assert await armed_by(Page(), RUN, HEADING, HEADING) == [0.0]


@virtual
async def test_rover_without_a_heading_or_without_anybody_who_looks_on_waits() -> None:
    assert await armed_by(Page(), RUN, {"record": "tick", "heading_deg": None}) == []
    page, rover = Page(), Rover()
    viewer = AutoArm(page, page.watched)
    async with viewer.serving(rover):  # type: ignore[arg-type]
        viewer.show(RUN)
        viewer.show(HEADING)
        await asyncio.sleep(1000.0)
    assert rover.armed == []


@pytest.mark.parametrize("header", [{"record": "run", "simulated": False}, {"record": "run"}, {"record": "event"}])
def test_run_that_does_not_say_that_it_is_simulated_is_never_armed(header: Record) -> None:
    @virtual
    async def check() -> None:
        assert await armed_by(Page(), header, HEADING) == []

    check()
