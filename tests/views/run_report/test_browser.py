"""The page of one run in a real browser, opened from disk without a network."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import DESKTOP, PHONE, OpenPage
from tests.views.run_report.logs import HEADER, OUTCOME, episode, write_log
from tests.views.text.records import event
from wayfarer.views.run_report.run import write_run_report


@pytest.mark.parametrize("viewport", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_page_shows_figures_and_tables_and_does_not_overflow(
    tmp_path: Path, browser_page: OpenPage, viewport: tuple[int, int]
) -> None:
    text = "<b>a mark</b> without an end" + "d" * 120
    run = write_log(tmp_path / "00017-run", [HEADER, *episode(), event("mark", 4.0, text=text), OUTCOME])
    opened = browser_page(viewport, offline=True)
    opened.page.goto(write_run_report(run).as_uri())
    assert opened.page.locator("figure svg").count() == 2
    assert opened.page.locator("tbody tr").count() == 2 + 1 + 2
    assert opened.page.locator("li", has_text="<b>a mark</b>").is_visible()
    assert opened.page.locator("figure svg text", has_text="heading, °").is_visible()
    assert opened.overflow_px() == 0
    assert opened.trouble == []
