"""A page with plots in a real browser, opened from disk without a network."""

from __future__ import annotations

from pathlib import Path

import pytest
from bokeh.plotting import ColumnDataSource

from tests.browser import DESKTOP, PHONE, Opened, OpenPage
from wayfarer.errors import BadInput
from wayfarer.views.page import html
from wayfarer.views.page.frame import write_page
from wayfarer.views.page.plots import Plots, hover, plot

HOSTILE = "</script><b>bold</b>"
SPEED = '[...Bokeh.documents[0]._all_models.values()].find((model) => model.name === "speed")'


def write(out: Path) -> Path:
    """A page with one line of two points, a layer that shows it, and a text that tries to break out."""
    plots = Plots()
    made = plot("speed", 200, "map", x_range=(0.0, 10.0), y_range=(0.0, 2.0))
    source = ColumnDataSource({"x": [0.0, 10.0], "y": [1.0, 1.0], "text": [HOSTILE, HOSTILE]})
    line = made.line("x", "y", source=source, line_width=6)
    line.tags = ["layer:speed"]
    made.add_tools(hover([line], ("what", "@text"), ("speed", "@y{0.0} m/s"), line_policy="interp"))
    body = [html.figure(plots.place(made), HOSTILE), html.layers("Show", [html.Layer("speed", "speed", "#0072B2")])]
    return write_page(out, HOSTILE, body, plots)


def opened(browser_page: OpenPage, page: Path, viewport: tuple[int, int] = DESKTOP) -> Opened:
    opened = browser_page(viewport, offline=True)
    opened.page.goto(page.as_uri())
    opened.page.wait_for_selector("html[data-plotted]", state="attached", timeout=10_000)
    return opened


@pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_page_draws_its_plots_without_a_network(
    tmp_path: Path, browser_page: OpenPage, viewport: tuple[int, int]
) -> None:
    shown = opened(browser_page, write(tmp_path / "page.html"), viewport)
    canvas = shown.page.locator(".plot canvas").first.bounding_box()
    assert canvas is not None
    assert 0.8 * viewport[0] < canvas["width"] <= viewport[0]
    assert shown.page.title() == HOSTILE
    assert shown.overflow_px() == 0
    assert shown.trouble == []


def test_pointer_is_told_what_is_under_it_as_text(tmp_path: Path, browser_page: OpenPage) -> None:
    shown = opened(browser_page, write(tmp_path / "page.html"))
    for y in (85, 90):  # the first movement brings the pointer in, the next one moves it
        shown.page.locator(".plot .bk-events").hover(position={"x": 300, "y": y})
    tip = shown.page.locator(".bk-Tooltip")
    tip.wait_for(timeout=10_000)
    values = tip.locator(".bk-tooltip-row-value")
    values.first.wait_for(timeout=10_000)
    assert values.all_inner_texts() == [HOSTILE, "1.0 m/s"]
    assert tip.locator("b").count() == 0


def test_box_hides_its_layer(tmp_path: Path, browser_page: OpenPage) -> None:
    shown = opened(browser_page, write(tmp_path / "page.html"))
    visible = f"{SPEED}.renderers[0].visible"
    assert shown.page.evaluate(visible) is True
    shown.page.get_by_label("speed").uncheck()
    assert shown.page.evaluate(visible) is False


def test_drag_moves_a_map_on_a_desk_and_scrolls_the_page_on_a_telephone(tmp_path: Path, browser_page: OpenPage) -> None:
    for viewport, moves in ((DESKTOP, True), (PHONE, False)):
        shown = opened(browser_page, write(tmp_path / "page.html"), viewport)
        mouse = shown.page.mouse
        box = shown.page.locator(".plot .bk-events").bounding_box()
        assert box is not None
        mouse.move(box["x"] + 150, box["y"] + 100)
        mouse.down()
        mouse.move(box["x"] + 100, box["y"] + 100, steps=4)
        mouse.up()
        shown.page.wait_for_timeout(100)
        assert (shown.page.evaluate(f"{SPEED}.x_range.start") > 0.1) is moves


def test_same_models_give_the_same_bytes(tmp_path: Path) -> None:
    assert write(tmp_path / "a.html").read_bytes() == write(tmp_path / "b.html").read_bytes()


def test_page_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match=r"cannot be written there: .*; name another file with --out"):
        write_page(tmp_path / "file" / "page.html", "A page", [])
