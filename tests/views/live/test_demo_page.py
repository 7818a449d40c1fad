"""The demo in a real browser: what it says, and what its buttons do to real daemons.

To start a demo takes seconds of CPU, so what does not end one shares it: each test begins with a press of Restart.
"""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Iterator
from contextlib import AbstractContextManager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.browser import DESKTOP, PHONE, Opened, OpenPage
from tests.views.live.contrast import weak_texts
from tests.views.live.daemons import Daemon, poll, running

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")
pytestmark = pytest.mark.process


# WCAG 2.2, target size (enhanced): 44 px.
SMALL = """() => [...document.querySelectorAll("button, input, a, select")].filter((each) => each.checkVisibility())
  .map((each) => [each.id || each.textContent, each.getBoundingClientRect()])
  .filter(([, box]) => box.width < 44 || box.height < 44 || box.left < 0 || box.right > innerWidth)
  .map(([name, box]) => `${name}: ${box.width} x ${box.height}`)"""


@pytest.fixture(scope="module")
def demo() -> Iterator[Daemon]:
    """A demo for all tests but the last one; they stand together, because it ends once it is left alone."""
    with running_demo() as found:
        yield found


def running_demo(speed: str = "6") -> AbstractContextManager[Daemon]:
    return running("demo", "--no-browser", "--live-port", "0", "--speed", speed)


def watch(browser_page: OpenPage, demo: Daemon) -> Opened:
    """Open the page, have the rover begin at its start and wait until it drives."""
    opened = browser_page()
    page = opened.page
    page.goto(demo.url)
    page.locator("#seed", has_text="forest").wait_for()
    if metres(opened) > 1.0 or page.locator("#next").is_visible():
        before = len(logs(demo))
        page.locator("#restart").click()
        poll(lambda: len(logs(demo)) > before)
        page.reload()
    poll(lambda: metres(opened) > 1.0, within_s=20.0)
    return opened


def metres(opened: Opened) -> float:
    return float(opened.page.locator("#mission-m").inner_text().split()[0])


def logs(demo: Daemon) -> list[Path]:
    return sorted((demo.folder / "logs").glob("*/run.jsonl"))


def records(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def test_demo_says_what_is_seen_and_everything_fits_a_finger(browser_page: OpenPage, demo: Daemon) -> None:
    opened = watch(browser_page, demo)
    page = opened.page
    page.locator("#demo", has_text="A rover without vision").wait_for()
    page.locator("#pace", has_text="Shown 6 times as fast").wait_for()
    page.locator("#legend li", has_text="Probing").wait_for(timeout=30_000)
    told = page.locator("#legend li").all_inner_texts()
    for what in (
        "the rover", "Standing", "Following the goal", "Backing off", "Turning away", "Probing", "something stopped it",
        "fallen trunk", "standing tree", "edge of the forest", "start",
    ):  # fmt: skip
        assert any(text.startswith(what) for text in told), (what, told)
    page.locator("#pause").click()
    page.locator("#pace", has_text="Paused").wait_for()
    assert_readable(opened)
    page.locator("#stop").click()  # in a pause, too
    page.locator("#banner", has_text="requested by a person").wait_for(timeout=3000)
    page.locator("#next", has_text="wayfarer sim --trials 1000").wait_for()
    assert records(logs(demo)[-1])[-1]["reason"] == "requested"
    assert_readable(opened)
    assert opened.trouble == []


def assert_readable(opened: Opened) -> None:
    """Check contrast in light and in dark, the size of what is touched, and that nothing is wider than the window."""
    page = opened.page
    for width, height in (PHONE, DESKTOP):
        page.set_viewport_size({"width": width, "height": height})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
            assert (weak_texts(page), page.evaluate(SMALL), opened.overflow_px()) == ([], [], 0), (width, scheme)


def test_pause_stops_the_time_and_the_page_stays_alive(browser_page: OpenPage, demo: Daemon) -> None:
    opened = watch(browser_page, demo)
    page = opened.page
    page.locator("#pause").click()
    page.locator("#age", has_text="paused").wait_for()
    stands_m = metres(opened)
    page.wait_for_timeout(2500)
    assert metres(opened) == stands_m
    assert "stale" not in (page.locator("body").get_attribute("class") or "")
    page.locator("#mark").fill("noted in a pause")
    page.locator("#mark").press("Enter")
    page.locator("#lines li", has_text="noted in a pause").wait_for()
    page.locator("#pause", has_text="Go on").click()
    poll(lambda: metres(opened) > stands_m + 2.0)
    names = [record.get("name") for record in records(logs(demo)[-1])]
    assert "clock_step" not in names, "nobody set the clock"
    ticks_s = [record["t_s"] for record in records(logs(demo)[-1]) if record["record"] == "tick"]
    assert max(after_s - before_s for before_s, after_s in pairwise(ticks_s)) < 0.06
    assert opened.trouble == []


def test_speed_is_that_of_the_button(browser_page: OpenPage, demo: Daemon) -> None:
    page = watch(browser_page, demo).page
    for speed, shown in (("1", "Shown in real time."), ("6", "Shown 6 times as fast.")):
        page.locator(f"#speeds [data-times='{speed}']").click()
        page.locator(f"#speeds [data-times='{speed}'][aria-pressed=true]").wait_for()
        assert page.locator("#speeds [aria-pressed=true]").count() == 1
        assert page.locator("#pace").inner_text() == shown


def test_restart_begins_the_same_forest_and_another_forest_is_another(browser_page: OpenPage, demo: Daemon) -> None:
    opened = watch(browser_page, demo)
    page = opened.page
    seed = int(page.locator("#seed").inner_text().removeprefix("forest "))
    poll(lambda: metres(opened) > 4.0, within_s=30.0)
    page.locator("#restart").click()
    poll(lambda: metres(opened) < 3.0)
    poll(lambda: metres(opened) > 1.0)  # it arms itself again
    page.locator("#forest").click()
    page.locator("#seed", has_text=f"forest {seed + 1}").wait_for()
    poll(lambda: 0.0 < metres(opened) < 5.0)
    assert page.locator("#banner").is_hidden(), "a run that the page itself replaced is no end"
    first, again, other = (records(path) for path in logs(demo)[-3:])
    assert first[0]["world"] == again[0]["world"] != other[0]["world"]
    assert [run[0]["seed"] for run in (first, again, other)] == [seed, seed, seed + 1]
    for run in (first, again):
        assert run[-1]["reason"] == "requested"
        assert any(record.get("name") == "wheels_stopped" for record in run)
    assert opened.trouble == []


def test_sigterm_after_the_run_ends_the_demo_well(browser_page: OpenPage, demo: Daemon) -> None:
    opened = watch(browser_page, demo)
    opened.page.locator("#stop").click()
    opened.page.locator("#next").wait_for()
    assert demo.process.stdout is not None
    assert any("the page and its buttons stay" in line for line in iter(demo.process.stdout.readline, ""))
    opened.page.wait_for_timeout(200)  # between the daemon's handlers and the demo's a signal would kill
    demo.process.send_signal(signal.SIGTERM)
    assert demo.process.wait(timeout=10) == 0
    assert "Traceback" not in (demo.folder / "stderr").read_text(encoding="utf-8")


def test_end_says_what_to_do_next_and_ctrl_c_ends_the_next_run_in_a_pause(browser_page: OpenPage) -> None:
    with running_demo(speed="60") as demo:
        opened = browser_page(PHONE)
        page = opened.page
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        page.goto(demo.url)
        page.locator("#seed", has_text="forest 22").wait_for()
        page.locator("#banner.good", has_text="escaped after").wait_for(timeout=60_000)
        told = page.locator("#next dt").all_inner_texts()
        folder = logs(demo)[0].parent
        assert {"wayfarer sim --trials 1000", f"wayfarer report {folder}", f"wayfarer logs show {folder}"} <= set(told)
        assert int(page.locator("#episodes").inner_text()) > 3
        assert page.locator("#lines li").count() > 20
        assert page.locator("#pause").is_hidden(), "there is nothing to pause"
        assert page.locator("#again").is_hidden()
        # At 60 times the next run would be over before a busy computer has looked at it.
        page.locator("#speeds button[data-times='1']").dispatch_event("click")
        page.locator("#forest").click()
        page.locator("body:not(.ended)").wait_for()
        page.locator("#seed", has_text="forest 23").wait_for()
        page.locator("#mode", has_text=re.compile("^Armed")).wait_for()
        assert page.locator("#next").is_hidden()
        assert opened.trouble == []
        assert [url for url in asked if not url.startswith("data:")] == [demo.url, f"ws://127.0.0.1:{demo.port}/ws"]
        page.locator("#pause").click()
        page.locator("#age", has_text="paused").wait_for()
        demo.process.send_signal(signal.SIGINT)
        assert demo.process.wait(timeout=10) == 0
        page.locator("#banner", has_text="ended by SIGINT. The demo is closed").wait_for()
        assert page.locator("#restart").is_disabled()
