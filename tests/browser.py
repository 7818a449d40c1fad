"""A real browser for the tests that want one: the system's Chromium, without a window, driven by Playwright.

A test asks for ``browser_page``, a function that opens a page of a given size in a context of its own; ``trouble`` of
what it returns collects what went wrong in it. The browser is that of all tests of a file: to start one takes about a
second. Playwright's blocking interface runs an event loop of its own, so only files of plain functions may use it,
if no test runs a loop. Import both fixtures in the ``conftest.py`` beside the tests.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, ViewportSize

NAMES = ("chromium", "chromium-browser", "google-chrome")
QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
DRAGS = 5
PHONE = (390, 844)
DESKTOP = (1280, 900)
SIZES = pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])


@dataclass
class Opened:
    """A page, and what went wrong in it so far: failed requests, scripts that raised, errors on the console."""

    page: Page
    trouble: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.page.on("requestfailed", lambda request: self.trouble.append(f"failed: {request.url}"))
        self.page.on("pageerror", lambda error: self.trouble.append(f"raised: {error}"))
        self.page.on("console", lambda said: self.trouble.append(said.text) if said.type == "error" else None)

    def overflow_px(self) -> int:
        """Return by how much the document is wider than the window."""
        return int(self.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth"))


class OpenPage(Protocol):
    """Opens an empty page with a window of this width and height in pixels.

    ``offline`` cuts its network, ``touch`` gives it a touch screen.
    """

    def __call__(self, viewport: tuple[int, int] = DESKTOP, *, offline: bool = False, touch: bool = False) -> Opened:
        """Open a page."""


def plotted(browser_page: OpenPage, page: Path, viewport: tuple[int, int] = DESKTOP) -> Opened:
    """Open a file without a network, and wait until its plots are drawn."""
    opened = browser_page(viewport, offline=True)
    opened.page.goto(page.as_uri())
    opened.page.wait_for_selector("html[data-plotted]", state="attached", timeout=30_000)
    return opened


def drag(page: Page, start: tuple[float, float], end: tuple[float, float], until: str) -> None:
    """Drag with the mouse from one pixel to another until JavaScript says that the page has obeyed.

    Bokeh takes a button that is held for 0.3 s without movement for a press, and no longer for a drag. On a busy
    computer that time can pass between two movements, so the drag is then done again, as a person would.
    """
    from playwright.sync_api import TimeoutError as NotYet

    for _ in range(DRAGS):
        page.mouse.move(*start)
        page.mouse.down()
        page.mouse.move(*end, steps=5)
        page.mouse.up()
        with suppress(NotYet):
            page.wait_for_function(until, timeout=6_000)
            return
    raise AssertionError(f"{DRAGS} drags were not obeyed: {until}")


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """A browser for the tests of a file; skips if there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip(f"none of {', '.join(NAMES)} is installed")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=list(QUIET))
        yield browser
        browser.close()


@contextmanager
def opening_pages(chromium: Browser) -> Iterator[OpenPage]:
    """Open pages, each with separate cookies, storage and network; all are closed at the end."""
    opened = []

    def open_page(viewport: tuple[int, int] = DESKTOP, *, offline: bool = False, touch: bool = False) -> Opened:
        width, height = viewport
        size: ViewportSize = {"width": width, "height": height}
        context = chromium.new_context(viewport=size, offline=offline, has_touch=touch, is_mobile=touch)
        opened.append(context)
        return Opened(context.new_page())

    yield open_page
    for context in opened:
        context.close()


@pytest.fixture
def browser_page(chromium: Browser) -> Iterator[OpenPage]:
    """Open pages, see ``opening_pages``; they are closed with the test."""
    with opening_pages(chromium) as open_page:
        yield open_page
