"""The page of a sweep in a real browser, opened from disk without a network."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import SIZES, OpenPage, plotted
from tests.experiments import fake_trials
from wayfarer.cli.run_trials import run_all
from wayfarer.experiments.campaign import Axis
from wayfarer.experiments.results import Results
from wayfarer.experiments.sweep import make_sweep
from wayfarer.reports.sweep import write_sweep_report

ANGLES, SLIPS = Axis("escape.turn_angle_deg", (10, 30, 50)), Axis("slip_mean_m", (2, 10))


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Where the pages of a sweep over one key and over two are."""
    written = {}
    for axes in ((ANGLES,), (ANGLES, SLIPS)):
        folder: Path = tmp_path_factory.mktemp("sweep")
        run_all(
            make_sweep(fake_trials.campaign_of(6, "pledge", "levy-walk"), axes), folder, run_trial=fake_trials.quick
        )
        written[len(axes)] = write_sweep_report(Results.open(folder))
    return written


@pytest.mark.parametrize("keys", [1, 2])
@SIZES
def test_page_draws_its_figures_and_tells_their_values(
    reports: dict[int, Path], browser_page: OpenPage, viewport: tuple[int, int], keys: int
) -> None:
    opened = plotted(browser_page, reports[keys], viewport)
    page = opened.page
    assert page.locator("figure .plot").count() == 5 * keys  # no SPL without shortest paths; two algorithms
    assert opened.overflow_px() == 0
    assert opened.trouble == []
    name = "pledge" if keys == 1 else "cells"
    model = f"[...Bokeh.documents[0]._all_models.values()].filter((each) => each.name === '{name}')[0]"
    y_column = "value" if keys == 1 else "y"
    x, y, text = page.evaluate(f"""() => {{
      const renderer = {model}, view = Bokeh.index.find_one(renderer), {{ data }} = renderer.data_source;
      view.parent.el.scrollIntoView({{ block: "center" }});
      const box = view.parent.canvas_view.el.getBoundingClientRect(), {{ x_scale, y_scale }} = view.parent.frame;
      return [box.x + x_scale.compute(data.x[1]), box.y + y_scale.compute(data.{y_column}[1]), data.text[1]];
    }}""")
    for off in (3, 0):
        page.mouse.move(x + off, y + off)
    values = page.locator(".bk-tooltip-row-value")
    values.first.wait_for(timeout=10_000)
    assert text in values.all_inner_texts()
    row = page.locator("table").last.locator("tbody tr:not(.group)").nth(1).inner_text().replace("\n[", " [")
    assert text in row
