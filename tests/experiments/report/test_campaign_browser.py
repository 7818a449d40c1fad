"""The page in a real browser, opened from disk without a network."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.browser import DESKTOP, PHONE, OpenPage
from wayfarer.experiments.report.campaign import write_report


@pytest.fixture(scope="module")
def report(finished: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Where the page is; written before the browser comes, because no trial can be run beside its event loop."""
    folder = shutil.copytree(finished, tmp_path_factory.mktemp("browsed") / "out")
    return write_report(Path(folder), gallery=2, jobs=1).as_uri()


@pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_page_shows_table_and_figures_and_does_not_overflow(
    report: str, browser_page: OpenPage, viewport: tuple[int, int]
) -> None:
    opened = browser_page(viewport, offline=True)
    opened.page.goto(report)
    assert opened.page.title() == "3 algorithms in 3 simulated forest trials each"
    assert opened.page.locator("tbody tr.ours").count() == 3
    drawings = opened.page.locator("figure svg")
    assert drawings.count() == 3 + 1 + 2 + 2  # overview, legend, gallery, and the entrapped trials of it
    for drawing in drawings.all():
        box = drawing.bounding_box()
        assert box is not None
        assert min(box["width"], box["height"]) > 40
    assert opened.page.locator("figure svg text", has_text="forest-pledge").first.is_visible()
    assert opened.overflow_px() == 0
    assert opened.trouble == []


def test_what_is_too_wide_for_a_phone_can_be_scrolled_by_keyboard(report: str, browser_page: OpenPage) -> None:
    opened = browser_page(PHONE, offline=True)
    opened.page.goto(report)
    opened.page.locator("div.table").first.focus()
    opened.page.keyboard.press("ArrowRight")
    opened.page.wait_for_function("document.querySelector('div.table').scrollLeft > 0")
    assert opened.overflow_px() == 0, "the table moved, and not the page"


def test_trouble_would_be_noticed(browser_page: OpenPage, tmp_path: Path) -> None:
    """The tests above can fail."""
    path = tmp_path / "bad.html"
    path.write_text(
        '<!DOCTYPE html><meta charset="utf-8"><div style="width: 500px">wide</div>'
        '<img src="http://127.0.0.1:9/x.png"><script>throw new Error("broken")</script>'
    )
    opened = browser_page(PHONE, offline=True)
    opened.page.goto(path.as_uri())
    assert opened.overflow_px() > 0
    assert any("x.png" in each for each in opened.trouble)
    assert any("broken" in each for each in opened.trouble)
