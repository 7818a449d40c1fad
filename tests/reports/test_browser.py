"""The page of a run in a real browser, opened from disk without a network."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.browser import PHONE, SIZES, OpenPage, drag, opening_pages, plotted
from tests.logview.records import noted
from tests.reports.logs import ARMED, HEADER, OUTCOME, by_time, episode, fix, write_log
from wayfarer.logview import palette
from wayfarer.reports.run import write_run_report

MODELS = "[...Bokeh.documents[0]._all_models.values()]"
SEEN = f"(({{x_range}}) => [x_range.start, x_range.end])({MODELS}.find((model) => model.name === 'speed'))"
RING = f"[...{MODELS}.find((model) => model.name === 'here').data_source.data.y]"
TEXT = "<b>a mark</b> without an end" + "d" * 120


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a run with an episode and a mark."""
    records = by_time(HEADER, ARMED, *episode(), fix(2.0, 2.0), noted(4.5, TEXT), OUTCOME)
    return write_run_report(write_log(tmp_path_factory.mktemp("runs") / "00017-20261121T061405Z", records))


@pytest.fixture(scope="module")
def desk(chromium: Browser, report: Path) -> Iterator[Page]:
    """That page in a wide window: drawing it takes seconds, so tests share it, and leave it as it was."""
    with opening_pages(chromium) as open_page:
        yield plotted(open_page, report, (1280, 800)).page


def read(page: Page, name: str) -> str:
    """What the cursor's bar says."""
    return page.locator(f".cursor [data-name='{name}'] dd").inner_text()


def at(page: Page, selector: str, right: float, down: float) -> tuple[float, float]:
    """Return the pixel at a part of a plot's width and of its height, after it was scrolled into sight."""
    plot = page.locator(selector).first
    plot.evaluate("plot => plot.scrollIntoView({ block: 'center' })")  # not behind the cursor's bar
    box = plot.bounding_box()
    assert box is not None
    return box["x"] + right * box["width"], box["y"] + down * box["height"]


def time_at(page: Page, selector: str, right: float, down: float) -> str:
    """Point there, and return the time that the cursor's bar then shows instead of the one before."""
    before = read(page, "time")
    x, y = at(page, selector, right, down)
    for step in (-4, 0):  # the first movement brings the pointer in, the next one moves it
        page.mouse.move(x + step, y)
    shown = "document.querySelector('.cursor [data-name=time] dd').innerText"
    page.wait_for_function(f"before => {shown} !== before", arg=before)
    return read(page, "time")


def panel(page: Page, title: str) -> str:
    """The selector of the plot under a title."""
    assert page.locator(".key", has_text=title).count() == 1
    return f".key:has-text('{title}') + .plot .bk-events"


@SIZES
def test_page_shows_plots_and_tables_and_does_not_overflow(
    report: Path, browser_page: OpenPage, viewport: tuple[int, int]
) -> None:
    shown = plotted(browser_page, report, viewport)
    assert shown.page.locator(".map .plot canvas").count() > 0
    assert shown.page.locator(".panels .key b").all_inner_texts() == [
        "events", "heading about the goal, °", "counter C, °", "tilt, °", "speed, m/s", "left wheel's duty",
        "right wheel's duty",
    ]  # fmt: skip
    assert shown.page.locator("tbody tr").count() == 2 + 1 + 3 + 2
    assert shown.page.locator("li", has_text="<b>a mark</b>").is_visible()
    assert shown.page.locator("a[href^='geo:']").is_visible()
    assert read(shown.page, "phase") == "Following the goal"  # the cursor begins at the end
    assert read(shown.page, "left wanted") == "0.50"
    assert shown.page.locator("dl.facts").is_hidden()
    shown.page.locator("summary").click()
    assert shown.page.locator("dl.facts").is_visible()
    assert shown.overflow_px() == 0
    assert shown.trouble == []


def test_whole_map_is_in_the_first_screen_and_is_brighter_on_a_dark_page(desk: Page) -> None:
    desk.evaluate("scrollTo(0, 0)")
    sentence = desk.locator(".result p").first
    said = sentence.inner_text()
    for text in (said, "word " * 40):  # a line, and two
        sentence.evaluate("(shown, text) => { shown.innerText = text; }", text)
        map_, bar = (desk.locator(each).bounding_box() for each in (".map .plot", ".cursor"))
        assert map_ is not None
        assert bar is not None
        assert map_["y"] + map_["height"] <= bar["y"]
    sentence.evaluate("(shown, text) => { shown.innerText = text; }", said)
    look = "getComputedStyle(document.querySelector('.map .plot')).filter"
    assert desk.evaluate(look) == "none"
    desk.emulate_media(color_scheme="dark")
    assert desk.evaluate(look) == f"brightness({palette.BRIGHTER})"
    desk.emulate_media(color_scheme="light")


def test_slider_moves_the_cursor_through_map_panels_and_values(report: Path, browser_page: OpenPage) -> None:
    shown = plotted(browser_page, report, PHONE)
    shown.page.locator(".cursor input").fill("2.2")
    assert read(shown.page, "time") == "0:00:02.2"
    assert read(shown.page, "phase") == "Backing off"
    assert read(shown.page, "commanded") == "1.00 m/s"
    lines = f"{MODELS}.filter((model) => model.tags.includes('cursor'))"
    assert shown.page.evaluate(f"{lines}.map((line) => line.location)") == [2.2] * 7
    (y_m,) = shown.page.evaluate(RING)
    assert y_m == pytest.approx(0.2, abs=0.06)  # one metre a second, from the fix at 2 s
    assert shown.overflow_px() == 0


def test_pointer_over_a_panel_moves_the_cursor(desk: Page) -> None:
    times = [time_at(desk, panel(desk, "speed"), right, 0.4) for right in (0.3, 0.6, 0.9)]
    assert times == sorted(times)
    assert len(set(times)) == 3


def test_pointer_over_the_map_finds_the_time(desk: Page) -> None:
    early, late = (time_at(desk, ".map .bk-events", 0.5, down) for down in (0.8, 0.1))
    assert early < late  # the rover drove north: what is above comes later


def test_drag_zooms_all_panels_and_the_button_shows_all_again(desk: Page) -> None:
    whole = desk.evaluate(SEEN)
    plot = panel(desk, "heading")
    drag(desk, at(desk, plot, 0.4, 0.4), at(desk, plot, 0.9, 0.5), f"{SEEN}[0] > {whole[0]}")
    start, end = desk.evaluate(SEEN)
    assert whole[0] < start < end < whole[1] + 1e-6
    desk.get_by_role("button", name="the whole time").click()
    assert desk.evaluate(SEEN) == whole
    desk.get_by_role("button", name="zoom in").click()
    start, end = desk.evaluate(SEEN)
    assert end - start < 0.7 * (whole[1] - whole[0])
    desk.get_by_role("button", name="the whole time").click()


def test_anomalies_can_be_switched_off_on_map_and_panels(desk: Page) -> None:
    visible = f"{MODELS}.filter((model) => model.tags.includes('layer:anomaly')).map((drawn) => drawn.visible)"
    assert desk.evaluate(visible) == [True, True]
    desk.get_by_label("anomalies").uncheck()
    assert desk.evaluate(visible) == [False, False]
    desk.get_by_label("anomalies").check()
    assert desk.evaluate(visible) == [True, True]
