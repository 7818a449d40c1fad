"""The page in a real browser, opened from disk without a network."""

from __future__ import annotations

import csv
import re
import statistics
from pathlib import Path
from typing import Any

import pytest

from tests.browser import PHONE, SIZES, Opened, OpenPage, plotted
from tests.reports.campaigns import ALGORITHMS
from wayfarer.experiments.results import TRIALS, Results
from wayfarer.reports.campaign import write_report

GALLERY = 3
MODEL = "[...Bokeh.documents[0]._all_models.values()].find((model) => model.name === {name!r})"


@pytest.fixture(scope="module")
def report(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the page is; written before the browser comes, because no trial can be run beside its event loop."""
    out = tmp_path_factory.mktemp("browsed") / "page.html"
    return write_report(Results.open(finished), out, gallery=GALLERY, jobs=1)


def asked(opened: Opened, name: str, what: str) -> Any:
    """Return what a model of this name says."""
    return opened.page.evaluate(f"{MODEL.format(name=name)}.{what}")


def pixel(opened: Opened, plot: str, x: float, y: float) -> tuple[float, float]:
    """Scroll to a plot, and return where a place of it is in the window."""
    place = opened.page.evaluate(
        f"""([x, y]) => {{
          const plot = {MODEL.format(name=plot)}, view = Bokeh.index.find_one(plot);
          view.el.scrollIntoView({{ block: "center" }});
          const box = view.canvas_view.el.getBoundingClientRect();
          return [box.x + view.frame.x_scale.compute(x), box.y + view.frame.y_scale.compute(y)];
        }}""",
        [x, y],
    )
    return place[0], place[1]


def told(opened: Opened, plot: str, x: float, y: float) -> str:
    """Return what the page says of a place of a plot when the pointer is there."""
    for off in (3, 0):  # the first movement brings the pointer in, the next one moves it
        at = pixel(opened, plot, x, y)
        opened.page.mouse.move(at[0] + off, at[1] + off)
    values = opened.page.locator(".bk-tooltip-row-value")
    values.first.wait_for(timeout=10_000)
    return " ".join(values.all_inner_texts())


@SIZES
def test_page_shows_table_and_figures_and_does_not_overflow(
    report: Path, browser_page: OpenPage, viewport: tuple[int, int]
) -> None:
    opened = plotted(browser_page, report, viewport)
    assert opened.page.title() == "3 algorithms in 3 simulated forest trials each"
    assert opened.page.locator("tbody tr.ours").count() == 3
    plots = opened.page.locator("figure .plot")
    assert plots.count() == 1 + 3 + 1 + GALLERY  # paths, three comparisons, escapes, maps
    for plot in plots.all():
        box = plot.bounding_box()
        assert box is not None
        assert box["width"] > 0.25 * viewport[0]
        assert box["height"] > 100
    for name in ("paths", "comparison, path", "escape"):
        frame = opened.page.evaluate(f"Bokeh.index.find_one({MODEL.format(name=name)}).frame.bbox.height")
        assert frame > 60, f"{name} has no room left"
    assert opened.overflow_px() == 0
    assert opened.trouble == []


@SIZES
def test_no_column_of_a_table_hides(report: Path, browser_page: OpenPage, viewport: tuple[int, int]) -> None:
    page = plotted(browser_page, report, viewport).page
    too_wide = "[...document.querySelectorAll('div.table')].filter((each) => each.scrollWidth > each.clientWidth)"
    assert page.evaluate(f"{too_wide}.length") == 0


def test_every_value_has_its_title_on_a_phone(report: Path, browser_page: OpenPage) -> None:
    page = plotted(browser_page, report, PHONE).page
    cell = page.locator("tr.ours td[data-column^='success %']").first
    assert "success % [95 %]" in cell.evaluate("cell => getComputedStyle(cell, '::before').content")


def test_pointer_curves_table_and_csv_tell_the_same_numbers(
    report: Path, finished: Path, browser_page: OpenPage
) -> None:
    with (finished / TRIALS).open(encoding="utf-8") as lines:
        rows = [row for row in csv.DictReader(lines) if row["algorithm"] == "forest-pledge"]
    paths_m = [float(row["path_m"]) for row in rows if row["outcome"] in ("escaped", "left_bounds")]
    assert len(paths_m) > 1
    opened = plotted(browser_page, report)
    mean = f"{statistics.fmean(paths_m):.1f} ± {statistics.stdev(paths_m):.1f}"
    line = opened.page.locator("tbody tr.ours", has_text="forest-pledge").inner_text()
    assert mean.partition(" ")[0] in line.split()
    y = asked(opened, "mean, ours", "data_source.data.y[0]")
    assert f"{mean} m" in told(opened, "paths", statistics.fmean(paths_m), y)

    success = re.search(r"(\d+\.\d)\s\[", line)
    assert success is not None
    percent = 100 * len(paths_m) / len(rows)
    assert success[1] == f"{percent:.1f}"
    last_m = max(float(row["path_m"]) for row in rows)
    said = told(opened, "escape", last_m, percent)
    assert "forest-pledge" in said
    assert f"{percent:.1f} %" in said


def test_every_figure_is_saved_as_svg(report: Path, browser_page: OpenPage) -> None:
    opened = plotted(browser_page, report)
    saved = {}
    for plot in opened.page.locator(".plot").all():
        plot.scroll_into_view_if_needed()
        with opened.page.expect_download() as download:
            plot.locator(".bk-tool-icon-save").click()
        saved[download.value.suggested_filename] = Path(download.value.path()).read_text(encoding="utf-8")
    assert len(saved) == 1 + 3 + 1 + GALLERY
    assert {"paths.svg", "comparison, SPL.svg", "escape.svg"} <= saved.keys()
    assert all(name.endswith(".svg") and text.lstrip().startswith("<svg") for name, text in saved.items())
    assert all(name in saved["paths.svg"] for name in ALGORITHMS)
