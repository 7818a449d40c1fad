"""The demo in a real browser: what it says, and what its buttons do to a real trial."""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Iterator
from contextlib import AbstractContextManager
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from tests.browser import DESKTOP, PHONE, Opened, OpenPage
from tests.remote.live.contrast import weak_texts
from tests.remote.live.daemons import Daemon, poll, running

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")
pytestmark = pytest.mark.process


# WCAG 2.2, target size (enhanced): 44 px.
SMALL = """() => [...document.querySelectorAll("button, input, a, select")].filter((each) => each.checkVisibility())
  .map((each) => [each.id || each.textContent, each.getBoundingClientRect()])
  .filter(([, box]) => box.width < 44 || box.height < 44 || box.left < 0 || box.right > innerWidth)
  .map(([name, box]) => `${name}: ${box.width} x ${box.height}`)"""


@pytest.fixture
def demo() -> Iterator[Daemon]:
    with running_demo() as found:
        yield found


def running_demo(speed: str = "6") -> AbstractContextManager[Daemon]:
    return running("demo", "--no-browser", "--live-port", "0", "--speed", speed)


def watch(browser_page: OpenPage, demo: Daemon) -> Opened:
    """Open the page, and wait until the rover drives."""
    opened = browser_page()
    opened.page.goto(demo.url)
    poll(lambda: metres(opened) > 1.0, within_s=20.0)
    return opened


def metres(opened: Opened) -> float:
    return float(opened.page.locator("#way").inner_text().split()[0])


def log(demo: Daemon) -> Path:
    (path,) = (demo.folder / "logs").glob("*/run.00001.jsonl")
    return path


def records(demo: Daemon) -> list[dict[str, Any]]:
    return [json.loads(line) for line in log(demo).read_text(encoding="utf-8").splitlines()]


def test_demo_says_what_is_seen_everything_fits_a_finger_and_stop_ends_it(browser_page: OpenPage, demo: Daemon) -> None:
    opened = watch(browser_page, demo)
    page = opened.page
    page.locator("#demo", has_text="A rover without vision").wait_for()
    page.locator("#pace", has_text="Shown 6 times as fast").wait_for()
    page.locator("#legend li", has_text="Probing").wait_for(timeout=30_000)
    told = page.locator("#legend li").all_inner_texts()
    for what in (
        "the rover", "Following the goal", "Backing off", "Turning away", "Probing", "something stopped it",
        "fallen trunk", "standing tree", "edge of the forest", "start",
    ):  # fmt: skip
        assert any(text.startswith(what) for text in told), (what, told)
    page.locator("#pause").click()
    page.locator("#pace", has_text="Paused").wait_for()
    assert_readable(opened)
    assert page.title() == "sim: Armed - wayfarer"
    assert re.search(
        r"now [+-]?\d+° off the goal, and counter C, now", page.locator("#curves").get_attribute("aria-label") or ""
    )
    assert_map_zooms(page)
    page.locator("#stop").click()  # in a pause, too
    page.locator("#banner", has_text="requested by a person").wait_for(timeout=3000)
    page.locator("#next", has_text="wayfarer sim --trials 1000").wait_for()
    assert page.locator(":is(#demo button, #sensors table):visible").count() == 0, "of no use after the end"
    assert records(demo)[-1]["reason"] == "requested"
    assert_readable(opened)
    assert opened.trouble == []
    assert demo.process.stdout is not None
    assert any("the page stays" in line for line in iter(demo.process.stdout.readline, ""))
    demo.process.send_signal(signal.SIGTERM)
    assert demo.process.wait(timeout=10) == 0
    assert "Traceback" not in (demo.folder / "stderr").read_text(encoding="utf-8")


# Two fingers that move apart on the map, from 40 to 120 pixels.
PINCH = """() => {
  const map = document.getElementById("map"), { left, top, width, height } = map.getBoundingClientRect();
  const y = top + height / 2, middle = left + width / 2;
  const finger = (identifier, clientX) => new Touch({ identifier, target: map, clientX, clientY: y });
  for (const [kind, half] of [["touchstart", 20], ["touchmove", 60], ["touchend", null]]) {
    const touches = half ? [finger(1, middle - half), finger(2, middle + half)] : [];
    map.dispatchEvent(new TouchEvent(kind, { touches, cancelable: true, bubbles: true }));
  }
}"""


def assert_map_zooms(page: Page) -> None:
    """Zoom a map that stands still, in each way that there is; afterwards it shows everything again."""
    box = page.locator("#map").bounding_box()
    assert box is not None
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)

    def picture() -> str:
        page.evaluate("() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
        return str(page.evaluate("document.getElementById('map').toDataURL()"))

    def ctrl_wheel() -> None:
        page.keyboard.down("Control")
        page.mouse.wheel(0.0, -240.0)
        page.keyboard.up("Control")

    whole = picture()
    assert page.locator("#whole").is_disabled()
    for zoom in (page.locator("#closer").click, ctrl_wheel, lambda: page.evaluate(PINCH)):
        page.mouse.move(*middle)
        zoom()
        poll(lambda: picture() != whole)
        closer = picture()
        page.mouse.move(*middle)
        page.mouse.down()
        page.mouse.move(middle[0] + 60.0, middle[1] + 40.0, steps=3)
        page.mouse.up()
        poll(lambda: picture() != closer)  # noqa: B023 - it is over at once
        page.locator("#whole").click()
        poll(lambda: picture() == whole)
    page.mouse.move(*middle)
    page.mouse.wheel(0.0, -240.0)
    assert picture() == whole, "the page scrolls, and the map stays"


def assert_readable(opened: Opened) -> None:
    """Check contrast in light and in dark, the size of what is touched, and that nothing is wider than the window."""
    page = opened.page
    for width, height in (PHONE, DESKTOP):
        page.set_viewport_size({"width": width, "height": height})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
            assert (weak_texts(page), page.evaluate(SMALL), opened.overflow_px()) == ([], [], 0), (width, scheme)


def test_pause_stops_the_time_speed_is_that_of_the_button_and_ctrl_c_ends_a_pause(
    browser_page: OpenPage, demo: Daemon
) -> None:
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
    ticks_s = [record["t_s"] for record in records(demo) if record["record"] == "tick"]
    assert max(after_s - before_s for before_s, after_s in pairwise(ticks_s)) < 0.06
    assert opened.trouble == []
    for speed, shown in (("1", "Shown in real time."), ("6", "Shown 6 times as fast.")):
        page.locator(f"#speeds [data-times='{speed}']").click()
        page.locator(f"#speeds [data-times='{speed}'][aria-pressed=true]").wait_for()
        assert page.locator("#speeds [aria-pressed=true]").count() == 1
        assert page.locator("#pace").inner_text() == shown
    page.locator("#pause").click()
    page.locator("#age", has_text="paused").wait_for()
    demo.process.send_signal(signal.SIGINT)
    assert demo.process.wait(timeout=10) == 0
    page.locator("#banner", has_text=re.compile("ended by SIGINT, .* The demo is closed")).wait_for()
    assert page.locator("#demo button:enabled").count() == 0


def test_end_says_what_to_do_next(browser_page: OpenPage) -> None:
    with running_demo(speed="60") as demo:
        opened = browser_page(PHONE)
        page = opened.page
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("websocket", lambda socket: asked.append(socket.url))
        page.goto(demo.url)
        page.locator("#seed", has_text="seed 22").wait_for()
        page.locator("#banner.good", has_text="crossed the destination line, 67.7 m driven in 0:01:29.").wait_for(
            timeout=60_000
        )
        told = page.locator("#next dt").all_inner_texts()
        folder = log(demo).parent
        assert {"wayfarer sim --trials 1000", f"wayfarer report {folder}", f"wayfarer logs show {folder}"} <= set(told)
        assert int(page.locator("#episodes").inner_text()) > 3
        assert page.locator("#lines li").count() > 20
        assert page.locator("#demo button:enabled").count() == 0, "there is no time that could be changed"
        assert (page.locator("#way").inner_text(), page.locator("#time").inner_text()) == ("67.7 m", "0:01:29")
        assert page.locator("#again").is_hidden()
        assert opened.trouble == []
        assert [url for url in asked if not url.startswith("data:")] == [demo.url, f"ws://127.0.0.1:{demo.port}/ws"]
