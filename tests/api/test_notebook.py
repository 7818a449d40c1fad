"""What a notebook shows of results and runs: the report's tables and figures, without a setting or a network."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wayfarer
from tests.browser import OpenPage, browser_page, chromium
from tests.experiments.fake_trials import campaign_of, quick
from tests.reports.logs import HEADER, OUTCOME, drawn, tick, write_log
from tests.reports.reading_plots import columns, names_of_rows
from wayfarer.experiments.campaign import Axis, Plan
from wayfarer.experiments.run import run as run_trials
from wayfarer.experiments.sweep import make_sweep
from wayfarer.reports.campaign import write_report
from wayfarer.reports.run import write_run_report
from wayfarer.reports.sweep import write_sweep_report

__all__ = ["browser_page", "chromium"]  # fixtures

BOTH = ("forest-pledge", "pledge")


def ran(plan: Plan, folder: Path | None = None) -> wayfarer.Results:
    with wayfarer.Results.kept(plan, folder) as results:
        run_trials(results, run_trial=quick)
    return results


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> wayfarer.Results:
    return ran(campaign_of(8, *BOTH), tmp_path_factory.mktemp("campaign") / "out")


@pytest.fixture(scope="module", params=[1, 2], ids=["one key", "two keys"])
def sweep(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> wayfarer.Results:
    axes = [Axis("escape.turn_angle_deg", (30, 60, 90)), Axis("slip_mean_m", (5.0, 10.0))][: request.param]
    return ran(make_sweep(campaign_of(2, *BOTH), axes, str), tmp_path_factory.mktemp("sweep") / "out")


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> tuple[wayfarer.Trial, wayfarer.Run]:
    folder = tmp_path_factory.mktemp("log") / "log"
    return wayfarer.run_trial(1, budget_m=60.0, log_dir=folder), wayfarer.open_run(folder)


class Cells(HTMLParser):
    """The rows of the tables in HTML, and the pages of its frames."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.frames: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "tr":
            self.rows.append([])
        elif tag in {"td", "th"}:
            self.rows[-1].append("")
        elif tag == "iframe":
            self.frames.append(dict(attrs)["srcdoc"] or "")

    def handle_data(self, data: str) -> None:
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.replace("\N{NO-BREAK SPACE}", " ")


def html_of(shown: Any) -> str:
    text: str = shown._repr_html_()
    return text


def page_of(plot: wayfarer.Plot) -> str:
    (page,) = Cells(html_of(plot)).frames
    return page


def interval(row: dict[str, Any], name: str, decimals: int) -> str:
    ends = ", ".join(f"{row[f'{name}_{end}']:.{decimals}f}" for end in ("low", "high"))
    return f"{row[name]:.{decimals}f}[{ends}]"


# -- tables


def test_results_and_summary_show_the_numbers_of_the_summary(campaign: wayfarer.Results) -> None:
    for shown in (campaign, campaign.summary):
        rows = {row[0]: row for row in Cells(html_of(shown)).rows}
        for row in campaign.summary:
            cells = rows[row["algorithm"]]
            assert {interval(row, "success_percent", 1), interval(row, "path_m", 1), interval(row, "spl", 3)} <= {
                *cells
            }
    assert "got out in" in html_of(campaign), "the result in a sentence, as the page begins"
    assert campaign.summary == list(campaign.summary), "a list of dicts, as before"
    assert [row["algorithm"] for row in campaign.summary] == [*BOTH]


def test_sweep_shows_a_row_for_each_point(sweep: wayfarer.Results) -> None:
    keys = [axis.key for axis in sweep.plan.axes]
    rows = {tuple(row[: 1 + len(keys)]): row for row in Cells(html_of(sweep)).rows}
    for row in sweep.summary:
        assert interval(row, "success_percent", 1) in rows[row["algorithm"], *(str(row[key]) for key in keys)]


def test_comparison_shows_its_table(campaign: wayfarer.Results) -> None:
    rows = [row._replace(path_m=(row.path_m or 0.0) + row.trial**2 * len(row.algorithm)) for row in campaign.rows]
    compared = wayfarer.compare(wayfarer.Results(campaign.plan, rows))
    low, high = (f"{compared[1][f'path_m_change_{end}']:+.1f}" for end in ("low", "high"))
    assert any(f"[{low}, {high}]" in cell for row in Cells(html_of(compared)).rows for cell in row)


def test_names_in_a_table_are_text() -> None:
    evil = wayfarer.Results(campaign_of(1, "<b>"), [row._replace(algorithm="<b>") for row in ran(campaign_of(1)).rows])
    assert "<b>" not in html_of(evil)
    assert "&lt;b&gt;" in html_of(evil)


@pytest.mark.process
def test_table_does_not_wait_for_bokeh() -> None:
    code = (
        "import sys, wayfarer\nfrom tests.experiments.fake_trials import campaign_of, quick\n"
        "from wayfarer.experiments.run import run\nresults = wayfarer.Results(campaign_of(3))\n"
        "run(results, run_trial=quick)\nassert results._repr_html_()\nsys.exit('bokeh' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# -- plots


def test_campaign_plots_the_figure_of_its_page(campaign: wayfarer.Results) -> None:
    plot = campaign.plot()
    (figure,) = plot.figures
    paths_m = [
        row.path_m or 0.0 for row in campaign.by_algorithm["pledge"] if row.outcome in {"escaped", "left_bounds"}
    ]
    boxes = columns(figure, "boxes")
    assert names_of_rows(figure) == [*BOTH]
    assert boxes["median"][boxes["algorithm"].index("pledge")] == pytest.approx(np.median(paths_m))
    page = write_report(campaign, gallery=0, jobs=1).read_text(encoding="utf-8")
    caption = re.search(r"<figcaption>.*?</figcaption>", page, re.DOTALL)
    assert caption
    assert caption[0] in page_of(plot)


def test_sweep_plots_the_figures_of_its_page(sweep: wayfarer.Results) -> None:
    plot = sweep.plot()
    page = write_sweep_report(sweep).read_text(encoding="utf-8")
    assert drawn(page_of(plot)) == drawn(page)
    for figure in plot.figures:
        name, _, algorithm = str(figure.name).partition(", ")
        shown = columns(figure, "cells" if algorithm else "pledge")["value"]
        own = [row[name] for row in sweep.summary if row["algorithm"] == (algorithm or "pledge")]
        assert shown == pytest.approx([np.nan if value is None else value for value in own], nan_ok=True)


def test_run_and_trial_plot_their_maps(trial: tuple[wayfarer.Trial, wayfarer.Run]) -> None:
    one, run = trial
    end = one.track[-1]
    (seen,), (true,) = run.plot().figures, one.plot().figures
    path = columns(seen, "path")
    assert (path["x"][-1], path["y"][-1]) == pytest.approx((end["x_m"], end["y_m"]), abs=0.1)
    ends = [each.data_source.data["x"] for each in true.renderers if list(each.data_source.data) == ["x", "y", "t_s"]]
    ended = list(run.ticks)[-1]  # with the wheels stopped, which the log has to a tenth of a millimetre
    assert list(ends[-1]) == pytest.approx([ended["truth_x_m"]], abs=1e-4)
    slips = sum(now["slipping"] > was["slipping"] for was, now in zip(one.track, one.track[1:], strict=False))
    assert f"{slips} slips" in page_of(one.plot())
    page = write_run_report(run.folder).read_text(encoding="utf-8")
    assert re.findall(r"<figcaption>.*?</figcaption>", page, re.DOTALL)[0] in page_of(run.plot())


def test_plot_is_shown_again_and_saved_with_the_same_figures(campaign: wayfarer.Results, tmp_path: Path) -> None:
    plot = campaign.plot()
    first = page_of(plot)
    assert page_of(plot) == first
    saved = plot.save(tmp_path / "new" / "paths.html")
    assert drawn(saved.read_text(encoding="utf-8")) == drawn(first)
    assert not re.search(r"<(?:script|link|img)[^>]*(?:src|href)=", first), "it asks no other host"
    plot.figures[0].height = 1234
    assert "1234" in drawn(page_of(plot))
    (tmp_path / "file").touch()
    with pytest.raises(wayfarer.WayfarerError, match=r"file/paths.html: the page cannot be written there"):
        plot.save(tmp_path / "file" / "paths.html")


def test_unfinished_results_show_what_there_is(campaign: wayfarer.Results, sweep: wayfarer.Results) -> None:
    for results in (campaign, sweep):
        some = wayfarer.Results(results.plan, results.rows[:5])
        for text in (html_of(some), page_of(some.plot())):
            assert f"Unfinished: 5 of {results.total} trials." in text
        none = wayfarer.Results(results.plan)
        assert none._repr_html_() is None, "it is printed"
        assert none.summary == []
        with pytest.raises(wayfarer.WayfarerError, match=f"^none of the {results.total} trials has ended yet"):
            none.plot()


def test_run_without_a_path_says_so(tmp_path: Path) -> None:
    folder = write_log(tmp_path / "1", [HEADER, *(tick(0.05 * at, heading_deg=None) for at in range(40)), OUTCOME])
    with pytest.raises(wayfarer.WayfarerError, match="there is no map of this run: the log has no heading"):
        wayfarer.open_run(folder).plot()


def test_what_is_not_installed_is_named_in_a_line(
    campaign: wayfarer.Results, trial: tuple[wayfarer.Trial, wayfarer.Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wayfarer.extras.find_spec", lambda name: None if name == "bokeh" else object())
    for plot in (campaign.plot, *(each.plot for each in trial)):
        with pytest.raises(
            wayfarer.WayfarerError, match=r"^a plot needs bokeh, which is not installed: .*\[sim\][^\n]*$"
        ):
            plot()
    monkeypatch.setattr("wayfarer.api.results.find_spec", lambda _: None)
    assert campaign._repr_html_() is None, "it is printed"


@pytest.mark.process
def test_frame_in_a_notebook_is_as_high_as_its_plots(
    campaign: wayfarer.Results, trial: tuple[wayfarer.Trial, wayfarer.Run], browser_page: OpenPage
) -> None:
    opened = browser_page(offline=True)
    opened.page.set_content(html_of(campaign.plot()) + html_of(trial[1].plot()))
    for frame in opened.page.frames[1:]:
        frame.wait_for_selector("html[data-plotted]", state="attached", timeout=30_000)
        frame.wait_for_function("frameElement.clientHeight == Math.ceil(document.body.offsetHeight)")
        frame.wait_for_function("document.querySelector('.plot').offsetHeight > 100")
    assert not opened.trouble
