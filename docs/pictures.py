"""The pictures of pages in the documentation: ``python -m docs.pictures`` makes all of them again, in two minutes.

They show the live page in the middle of the demo's escape and at its end, the pad while a person drives, and the path
of a rover through one layout of each site. ``pictures.json`` beside them has a checksum of what each shows: its page,
and the run on it. ``tests/docs/test_pictures.py`` computes them again, without a browser, so it finds a picture that is
older than what it shows.
"""

from __future__ import annotations

import json
import shutil
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import bokeh
import msgspec

from wayfarer import run_trial
from wayfarer.cli.demo import SEED
from wayfarer.fieldlog.reader import RunReader
from wayfarer.logview import palette
from wayfarer.remote.live.model import PageModel
from wayfarer.remote.live.server import document
from wayfarer.reports.page import html
from wayfarer.reports.page.plots import Plots
from wayfarer.reports.worst_trials import MAP
from wayfarer.vocabulary import in_words

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, ViewportSize

IMAGES = Path(__file__).parent / "images"
CHECKSUMS = IMAGES / "pictures.json"
SIZES: dict[str, ViewportSize] = {
    "desktop": {"width": 1280, "height": 900},
    "phone": {"width": 390, "height": 844},
}
MOMENTS = ("middle", "end")
MIDDLE_M = 35.0  # of the 68 m of the default demo
PAD, SITES = "live-phone-drive", "scenarios"
LAYOUTS = {
    "extended-maze": ("forestrover", 3),
    "dense-obstruction": ("minirover", 1),
    "forest-escape": ("forestrover", 0),
}


def checksums() -> dict[str, str]:
    """Return a checksum of what each picture shows now, by the picture's name.

    That of the pad is of its page only: a person drives elsewhere each time. The versions of wayfarer and Bokeh do not
    count.
    """
    page = document().html
    demo = _checksum(page + _demo_content())
    with TemporaryDirectory() as folder:
        sites = _sites_page(Path(folder)).read_text(encoding="utf-8")
    drawn = sites.replace(html.bokeh_js(), "").replace(bokeh.__version__, "")
    live = {f"live-{size}-{moment}": demo for size in SIZES for moment in MOMENTS}
    return {**live, PAD: _checksum(page), SITES: _checksum(drawn.encode())}


def _checksum(content: bytes) -> str:
    return sha256(content).hexdigest()


def _demo_content() -> bytes:
    """Return all that the page shows of the demo's trial, which is a trial of ``wayfarer sim``."""
    model = PageModel()
    with TemporaryDirectory() as folder:
        run_trial(0, seed=SEED, log_dir=folder)
        for record in RunReader(Path(folder)):
            model.add(record)
    content = model.snapshot()
    del content["about"]["version"]
    return msgspec.json.encode(content)


def _sites_page(folder: Path) -> Path:
    """Write a page of one layout of each site, with the path of a rover through it."""
    plots, maps, driven = Plots(), [], set[str]()
    for site, (rover, layout) in LAYOUTS.items():
        trial = run_trial(layout, site=site, rover=rover)
        driven |= {tick["phase"] for tick in trial.track}
        (drawn,) = trial.plot().figures
        drawn.toolbar_location = None
        ended = f"{site}, layout {layout}: {rover}, {trial.row.time_s:.0f} s"
        maps.append(html.figure(plots.place(drawn), ended))
    key = [(in_words(phase), colour) for phase, colour in palette.PHASE_COLOURS.items() if phase in driven]
    body = [html.panels(maps), html.key("", [*key, ("slip", palette.ANOMALY)]), html.paragraph(MAP)]
    return html.write_page(folder / "sites.html", "Sites", body, plots)


def main() -> None:
    """Take all pictures, and write their checksums."""
    from playwright.sync_api import sync_playwright

    from tests.browser import NAMES, QUIET

    with sync_playwright() as playwright:
        chromium = next(filter(None, map(shutil.which, NAMES)))
        browser = playwright.chromium.launch(executable_path=chromium, args=list(QUIET))
        _take_demo(browser)
        _take_pad(browser)
        _take_sites(browser)
        browser.close()
    CHECKSUMS.write_text(json.dumps(checksums(), indent=2) + "\n", encoding="utf-8")


def _take_demo(browser: Browser) -> None:
    from tests.remote.live.daemons import running

    with running("demo", "--no-browser", "--live-port", "0") as demo:
        pages = {size: browser.new_page(viewport=viewport) for size, viewport in SIZES.items()}
        for page in pages.values():
            page.goto(demo.url)
        seen = pages["desktop"]
        while float(seen.locator("#way").inner_text().split()[0]) < MIDDLE_M:
            seen.wait_for_timeout(50)
        for moment in MOMENTS:
            if moment == "end":
                seen.locator("body.ended").wait_for(timeout=60_000)
            for size, page in pages.items():
                _take(page, f"live-{size}-{moment}", whole=size == "desktop")


def _take_pad(browser: Browser) -> None:
    from tests.browser import Opened
    from tests.remote.live.daemons import running
    from tests.remote.live.test_pad import Driver

    with running("run", "--sim", "--manual", "--live", "--live-port", "0") as daemon:
        daemon.arm()
        opened = Opened(browser.new_page(viewport=SIZES["phone"], has_touch=True, is_mobile=True))
        driver = Driver(opened, daemon)
        driver.begin()
        driver.drag(0.12, 0.25)
        opened.page.locator("#link", has_text="Driving").wait_for()
        opened.page.wait_for_timeout(7_000)  # until it has driven a little, and the reply is gone
        _take(opened.page, PAD)


def _take_sites(browser: Browser) -> None:
    page = browser.new_page(viewport=SIZES["desktop"])
    with TemporaryDirectory() as folder:
        page.goto(_sites_page(Path(folder)).as_uri())
        page.locator("html[data-plotted]").wait_for(state="attached")
    page.add_style_tag(content="h1 { display: none; }")
    page.wait_for_timeout(500)  # until the plots are as wide as their places
    page.locator("main").screenshot(path=IMAGES / f"{SITES}.png")


def _take(page: Page, name: str, *, whole: bool = False) -> None:
    page.screenshot(path=IMAGES / f"{name}.png", full_page=whole)


if __name__ == "__main__":
    main()
