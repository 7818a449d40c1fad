"""The runs of a demo: what its page may ask for between them and in them. Its buttons: ``tests/views/live``."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import nullcontext
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from tests.virtual import run_virtually
from wayfarer.daemon.socket.protocol import Refused
from wayfarer.experiments import demo as module
from wayfarer.experiments.demo import AutoArm, Demo, ForwardedCommands
from wayfarer.fieldlog.schema import Record
from wayfarer.simhal.clock.scaled_loop import ScaledLoop

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")

RUN = {"record": "run", "part": 1, "log": "logs/1"}
OUTCOME = {"record": "outcome", "reason": "requested", "text": "requested by a person"}


class Rover:
    """Keeps what it is asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Any]] = []

    async def stop(self) -> dict[str, Any]:
        self.asked.append(("stop", None))
        return {}

    async def mark(self, text: str) -> dict[str, Any]:
        self.asked.append(("mark", text))
        return {}


class Page:
    """A page without a thread or a server, which nobody has open; keeps what it is shown."""

    is_watched = False

    def __init__(self) -> None:
        self.shown: list[Any] = []
        self.begin_run = self.show = self.shown.append

    def call_soon_threadsafe(self, function: Any, *arguments: Any) -> None:
        function(*arguments)


@pytest.fixture
def page() -> Page:
    return Page()


@pytest.fixture
def demo(page: Page, monkeypatch: pytest.MonkeyPatch) -> Demo:
    monkeypatch.setattr(module, "LOOK_S", 0.01)
    monkeypatch.setattr(module, "LEFT_S", 0.03)
    found = Demo(seed=5, speed=50.0)
    found._page = found._page_loop = page  # type: ignore[assignment]
    return found


def run(demo: Demo, rover: Rover, during: Any = None) -> bool:
    """Have a run of the demo; return whether it was begun by somebody who looks on."""

    async def main() -> bool:
        async with demo.serving(rover):  # type: ignore[arg-type]
            if during is not None:
                await asyncio.to_thread(during)
            await asyncio.sleep(0.1)
            return demo.watched.is_set()

    with asyncio.Runner(loop_factory=partial(ScaledLoop, demo.time_scale)) as runner:
        return runner.run(main())


def test_demo_that_nobody_watches_is_over_after_its_run(demo: Demo) -> None:
    assert list(demo.seeds()) == [5]


def test_demo_waits_while_its_page_is_open(demo: Demo, page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    looks = iter([True] * 20 + [False] * 20)
    monkeypatch.setattr(Page, "is_watched", property(lambda _: next(looks)))
    assert list(demo.seeds()) == [5]
    assert len(list(looks)) < 20


@pytest.mark.parametrize(
    ("presses", "seed"), [([False], 5), ([True], 6), ([True, True], 7), ([True, False, True], 7)], ids=str
)
def test_presses_count_from_the_forest_that_is_shown(demo: Demo, presses: list[bool], seed: int) -> None:
    seeds = demo.seeds()
    assert next(seeds) == 5
    for each in presses:
        demo.begin_again(each)
    assert next(seeds) == seed
    assert next(seeds, None) is None


def test_press_in_a_run_ends_it_and_its_end_is_not_shown(demo: Demo, page: Page) -> None:
    rover = Rover()
    next(demo.seeds())

    def press() -> None:
        demo.pause(True)
        demo.begin_again(True)

    run(demo, rover, press)
    demo.show(RUN)
    demo.show(OUTCOME)
    assert rover.asked == [("stop", None)]
    assert not demo.time_scale.paused, "an end takes time"
    assert page.shown == [RUN]


def test_press_before_a_run_is_there_ends_it_at_once(demo: Demo) -> None:
    rover = Rover()
    demo.begin_again(False)
    run(demo, rover)
    assert rover.asked == [("stop", None)]


def test_end_of_a_run_that_nobody_replaced_is_shown(demo: Demo, page: Page) -> None:
    for record in (RUN, OUTCOME):
        demo.show(record)
    assert page.shown == [RUN, OUTCOME]
    assert demo.now().log == "logs/1"


def test_run_begins_when_somebody_sees_the_page_and_every_later_one_at_once(demo: Demo) -> None:
    seeds = demo.seeds()
    next(seeds)
    assert not run(demo, Rover())
    assert run(demo, Rover(), demo.seen)
    demo.begin_again(False)
    next(seeds)
    assert run(demo, Rover())


@pytest.fixture
def forwarded(demo: Demo) -> Iterator[Any]:
    yield ForwardedCommands(demo)


def test_command_is_done_by_the_run_and_stop_ends_a_pause(demo: Demo, forwarded: Any) -> None:
    rover = Rover()
    demo.pause(True)
    paused = SimpleNamespace()

    def ask() -> None:
        asyncio.run(forwarded.mark(text="log"))
        paused.after_mark = demo.time_scale.paused
        asyncio.run(forwarded.stop())
        paused.after_stop = demo.time_scale.paused

    run(demo, rover, ask)
    assert rover.asked == [("mark", "log"), ("stop", None)]
    assert (paused.after_mark, paused.after_stop) == (True, False)


def test_command_without_a_run_is_refused(demo: Demo, forwarded: Any) -> None:
    with pytest.raises(Refused, match="no run is active"):
        asyncio.run(forwarded.stop())


def test_page_is_served_in_another_thread_until_the_demo_ends(demo: Demo) -> None:
    from wayfarer.views.live.server import LivePage  # needs aiohttp

    page = LivePage("127.0.0.1", 0, "token", demo=demo)
    with demo.serve_page(page):
        demo.show(RUN)
        with urlopen(page.url, timeout=5.0) as answer:
            assert answer.status == 200
    with pytest.raises(URLError):
        urlopen(page.url, timeout=5.0)


# -- a rover arms itself for a viewer; that nothing else does: ``tests/test_imports.py`` -------------------------------


SIMULATED: Record = {"record": "run", "simulated": True}
HEADING: Record = {"record": "tick", "heading_deg": 0.0}
WAITS = {
    "no heading": ([SIMULATED, {"record": "tick", "heading_deg": None}], True),
    "nobody looks on": ([SIMULATED, HEADING], False),
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
    assert run_virtually(armed([SIMULATED, HEADING, HEADING], watched=True)) == [0.0]


@pytest.mark.parametrize(("records", "watched"), WAITS.values(), ids=WAITS)
def test_rover_is_not_armed_otherwise_nor_where_the_run_does_not_say_that_it_is_simulated(
    records: list[Record], watched: bool
) -> None:
    assert run_virtually(armed(records, watched)) == []
