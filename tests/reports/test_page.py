"""A page with plots in a real browser, opened from disk without a network."""

from __future__ import annotations

from pathlib import Path

import pytest
from bokeh.plotting import ColumnDataSource

from tests.browser import PHONE, SIZES, Opened, OpenPage, drag, plotted
from wayfarer.errors import BadInput
from wayfarer.reports.page import html
from wayfarer.reports.page.html import write_page
from wayfarer.reports.page.plots import Plots, hover, plot

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
    body = [html.figure(plots.place(made), HOSTILE), html.layers("Show", [html.PlotLayer("speed", "speed", "#0072B2")])]
    return write_page(out, HOSTILE, body, plots)


@SIZES
def test_page_draws_its_plots_without_a_network(
    tmp_path: Path, browser_page: OpenPage, viewport: tuple[int, int]
) -> None:
    shown = plotted(browser_page, write(tmp_path / "page.html"), viewport)
    canvas = shown.page.locator(".plot canvas").first.bounding_box()
    assert canvas is not None
    assert 0.8 * viewport[0] < canvas["width"] <= viewport[0]
    assert shown.page.title() == HOSTILE
    assert shown.overflow_px() == 0
    assert shown.trouble == []


def test_pointer_is_told_what_is_under_it_as_text(tmp_path: Path, browser_page: OpenPage) -> None:
    shown = plotted(browser_page, write(tmp_path / "page.html"))
    for y in (85, 90):  # the first movement brings the pointer in, the next one moves it
        shown.page.locator(".plot .bk-events").hover(position={"x": 300, "y": y})
    tip = shown.page.locator(".bk-tooltip-content")
    tip.wait_for(timeout=10_000)
    assert tip.inner_text().split("\n") == [f"what:\t{HOSTILE}", "speed:\t1.0 m/s"]


def test_box_hides_its_layer(tmp_path: Path, browser_page: OpenPage) -> None:
    shown = plotted(browser_page, write(tmp_path / "page.html"))
    visible = f"{SPEED}.renderers[0].visible"
    assert shown.page.evaluate(visible) is True
    shown.page.get_by_label("speed").uncheck()
    assert shown.page.evaluate(visible) is False


def test_drag_moves_a_map(tmp_path: Path, browser_page: OpenPage) -> None:
    shown = plotted(browser_page, write(tmp_path / "page.html"))
    x, y = middle(shown)
    drag(shown.page, (x, y), (x - 100, y), f"{SPEED}.x_range.start > 0.1")


def test_finger_over_a_plot_scrolls_the_page(tmp_path: Path, browser_page: OpenPage) -> None:
    shown = plotted(browser_page, write(tmp_path / "page.html"), (PHONE[0], 300))
    x, y = middle(shown)
    hand = shown.page.context.new_cdp_session(shown.page)
    hand.send("Emulation.setTouchEmulationEnabled", {"enabled": True})
    hand.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for step in range(1, 11):
        hand.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y - 10 * step}]})
    hand.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    shown.page.wait_for_function("scrollY > 20", timeout=10_000)
    assert shown.page.evaluate(f"{SPEED}.y_range.end") == 2.0


def middle(shown: Opened) -> tuple[float, float]:
    """The middle of the plot, in pixels of the window."""
    box = shown.page.locator(".plot .bk-events").bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0


def test_page_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match=r"cannot be written there: .*; name another file with --out"):
        write_page(tmp_path / "file" / "page.html", "A page", [], Plots())


def test_text_is_escaped_once_and_a_line_feed_in_a_table_parts_lines(tmp_path: Path) -> None:
    table = html.table(HOSTILE, ["who", "path\nm"], [("group", ["a & b", "1\n<2"])])
    text = write_page(tmp_path / "page.html", HOSTILE, [html.section(HOSTILE, table), HOSTILE], Plots()).read_text()
    assert HOSTILE not in text
    assert text.count("&lt;/script&gt;&lt;b&gt;bold&lt;/b&gt;") == 5, "title, heading, section, caption, and body"
    assert '<th scope="row">a &amp; b</th><td data-column="path m">1<br>&lt;2</td>' in text
    assert '<th scope="col" data-column="path m">path<br>m</th>' in text
