"""A simulated rover arms itself for a viewer. That nothing else does: ``tests/test_imports.py``."""

from __future__ import annotations

import asyncio
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import pytest

from tests.virtual import run_virtually
from wayfarer.experiments.auto_arm import AutoArm
from wayfarer.fieldlog.schema import Record

RUN: Record = {"record": "run", "simulated": True}
HEADING: Record = {"record": "tick", "heading_deg": 0.0}
WAITS = {
    "no heading": ([RUN, {"record": "tick", "heading_deg": None}], True),
    "nobody looks on": ([RUN, HEADING], False),
    "real": ([{"record": "run", "simulated": False}, HEADING], True),
    "does not say": ([{"record": "run"}, HEADING], True),
    "no header": ([{"record": "event"}, HEADING], True),
}


async def armed(records: list[Record], watched: bool) -> list[float]:
    """Show records on a page that is watched or not, and return how the rover was armed."""
    shown: list[Record] = []
    page: Any = SimpleNamespace(show=shown.append, serving=lambda commands: nullcontext())
    looks_on, rover = asyncio.Event(), AsyncMock()
    viewer = AutoArm(page, looks_on)
    async with viewer.serving(rover):
        if watched:
            looks_on.set()
        for record in records:
            viewer.show(record)
        await asyncio.sleep(1000.0)
    assert shown == records
    return [call.args[0] for call in rover.arm.await_args_list]


def test_rover_is_armed_once_when_it_is_watched_and_knows_its_heading() -> None:
    assert run_virtually(armed([RUN, HEADING, HEADING], watched=True)) == [0.0]


@pytest.mark.parametrize(("records", "watched"), WAITS.values(), ids=WAITS)
def test_rover_is_not_armed_otherwise_nor_where_the_run_does_not_say_that_it_is_simulated(
    records: list[Record], watched: bool
) -> None:
    assert run_virtually(armed(records, watched)) == []
