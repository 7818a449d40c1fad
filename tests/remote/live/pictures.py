"""Pictures of the live page for the documents: ``python -m tests.remote.live.pictures``; half a minute.

A demo is photographed in the middle of its escape and at its end, on a desk and on a telephone; a daemon while a person
drives its rover with a finger.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright

from tests.browser import DESKTOP, NAMES, PHONE, QUIET, Opened
from tests.remote.live.daemons import running
from tests.remote.live.test_pad import Driver

FOLDER = Path(__file__).parents[3] / "docs" / "images"
SIZES: dict[str, ViewportSize] = {
    "desktop": {"width": DESKTOP[0], "height": DESKTOP[1]},
    "phone": {"width": PHONE[0], "height": PHONE[1]},
}
MIDDLE_M = 45.0  # of the 75 m of the default demo


def main() -> None:
    """Take the pictures."""
    chromium = next(filter(None, map(shutil.which, NAMES)))
    with running("demo", "--no-browser", "--live-port", "0") as demo, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=list(QUIET))
        pages = {name: browser.new_page(viewport=size) for name, size in SIZES.items()}
        for page in pages.values():
            page.goto(demo.url)
        _wait_for_metres(pages["desktop"], MIDDLE_M)
        _take(pages, "middle")
        pages["desktop"].locator("body.ended").wait_for(timeout=60_000)
        _take(pages, "end")
        _take_pad(browser)
        browser.close()


def _take_pad(browser: Browser) -> None:
    with running("run", "--sim", "--manual", "--live", "--live-port", "0") as daemon:
        daemon.arm()
        opened = Opened(browser.new_page(viewport=SIZES["phone"], has_touch=True, is_mobile=True))
        driver = Driver(opened, daemon)
        driver.begin()
        driver.drag(0.12, 0.25)
        opened.page.locator("#link", has_text="Driving").wait_for()
        opened.page.wait_for_timeout(7_000)  # until it has driven a little, and the reply is gone
        _take({"phone": opened.page}, "drive")


def _wait_for_metres(page: Page, metres: float) -> None:
    while float(page.locator("#way").inner_text().split()[0]) < metres:
        page.wait_for_timeout(50)


def _take(pages: dict[str, Page], when: str) -> None:
    for name, page in pages.items():
        page.screenshot(path=FOLDER / f"live-{name}-{when}.png", full_page=name == "desktop")


if __name__ == "__main__":
    main()
