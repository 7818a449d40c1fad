"""The report of a campaign: ``report.html`` in its folder."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.progress_bar import shown_progress
from wayfarer.experiments.report import words
from wayfarer.experiments.report.algorithm_rows import grouped
from wayfarer.experiments.report.escape_figure import escape_figures
from wayfarer.experiments.report.load_results import CampaignResults, read_results
from wayfarer.experiments.report.paths_figure import failures_figure, paths_figure
from wayfarer.experiments.report.ratio_figure import ratio_figure, ratios_table
from wayfarer.experiments.report.trial_map import trial_map
from wayfarer.experiments.report.worst_trials import RerunTrial, choose, run_again
from wayfarer.experiments.tables import (
    NAME_COLUMN,
    OUTCOME_COLUMNS,
    PAPER_FIGURES,
    PATH_COLUMNS,
    PaperColumn,
    fault_columns,
    lines_of,
)
from wayfarer.views import palette
from wayfarer.views.page import html
from wayfarer.views.page.frame import PAGE, write_page
from wayfarer.views.page.plots import Figure, Plots

SLIPS = html.PlotLayer("slips", "Slips", palette.ANOMALY)
TABLE_CAPTION = "Success with its 95 % interval; path: of the successes; time and anomalies: mean a trial."


def write_report(
    folder: Path, out: Path | None = None, *, gallery: int = 12, jobs: int, allow_code: bool = False
) -> Path:
    """Write the report of the campaign in ``folder``, and return the page's path: ``out``, or ``report.html`` in it.

    ``gallery`` is how many trials are drawn; they are run again for that, in ``jobs`` processes. The same folder gives
    the same bytes. ``allow_code`` as of ``CampaignResults.rebuild``.

    Raises:
        BadInput: the folder holds no finished campaign, is damaged, or cannot be written.
        WayfarerError: a worker process died.
    """
    results, plots = read_results(folder), Plots()
    body = [*_overview(results, plots), *_worst(results, plots, gallery, jobs, allow_code=allow_code)]
    return write_page(folder / PAGE, words.title(results), body, plots, out=out)


def _overview(results: CampaignResults, plots: Plots) -> Iterator[str]:
    """Yield all sections that need no trial to be run again."""
    rows, summaries = results.by_algorithm, results.summaries

    def drawn(figure: Figure, caption: str = "", alt: str = "") -> str:
        return html.figure(plots.place(figure), caption, alt)

    yield html.facts(words.facts(results.settings))
    yield html.section(
        "Path length and failures",
        drawn(
            paths_figure(rows, summaries, results.shortest_paths_m),
            words.paths_caption(results),
            "Path length by algorithm",
        ),
        drawn(failures_figure(summaries), words.FAILURES_CAPTION, "Trials that did not get out, by algorithm"),
    )
    yield html.section("Results beside the paper's", _results_table(results), *map(html.paragraph, words.LEGEND))
    yield html.section(
        "Escapes by path length",
        html.paragraph(words.ESCAPE),
        html.panels(drawn(figure, alt="Share of escaped trials by path length") for figure in escape_figures(rows)),
    )
    heading = "Path over shortest path"
    if results.shortest_paths_m:
        figure = drawn(ratio_figure(rows), words.ratio_caption(results), "Path over shortest path")
        yield html.section(heading, figure, ratios_table(rows))
    else:
        yield html.section(heading, html.paragraph(words.NO_SHORTEST_PATHS))


def _results_table(results: CampaignResults) -> str:
    """Return a row for each algorithm, under its group, with a row of the paper's below where the paper has one."""
    columns = (NAME_COLUMN, *OUTCOME_COLUMNS, *fault_columns(results.summaries.values()), *PATH_COLUMNS)
    return html.table(TABLE_CAPTION, [column.title for column in columns], _results_rows(results, columns))


def _results_rows(results: CampaignResults, columns: Sequence[PaperColumn]) -> Iterator[tuple[str, list[str]]]:
    for group in grouped(results.settings.algorithms):
        yield "group", [group.title, *[""] * (len(columns) - 1)]
        for name in group.algorithms:
            for whose, cells in lines_of(results.summaries[name], columns, PAPER_FIGURES):
                yield whose, [cell.strip() for cell in cells]


def _worst(results: CampaignResults, plots: Plots, count: int, jobs: int, *, allow_code: bool) -> Iterator[str]:
    """Yield the sections on the worst trials, which are run again for that."""
    heading = "The worst trials, seen from above"
    rows = choose(results.by_algorithm, count)
    if not rows:
        yield html.section(heading, html.paragraph("No trial is drawn."))
        return
    try:
        campaign = results.rebuild(allow_code=allow_code)
    except BadInput as reason:
        yield html.section(heading, html.paragraph(f"No trial is drawn: {reason}."))
        return
    with shown_progress(Console(stderr=True), 0, len(rows)) as progress:
        ran = run_again(campaign, rows, jobs, progress)
    yield html.section(heading, *_gallery(campaign, ran, plots), *_not_drawn(ran, results.settings.version))


def _gallery(campaign: Campaign, ran: Sequence[RerunTrial], plots: Plots) -> Iterator[str]:
    """Yield the maps of the trials beside each other, under one key for all."""
    maps = []
    for row, trajectory, _ in ran:
        if trajectory is not None:
            drawn = trial_map(f"{row.algorithm}-{row.trial}", campaign.make_forest(row.trial), trajectory)
            maps.append(html.figure(plots.place(drawn), words.trial_text(row, len(trajectory.slips_m))))
    if maps:
        yield html.paragraph(words.GALLERY)
        yield html.layers("Show", [*html.phase_layers(), SLIPS])
        yield html.panels(maps)


def _not_drawn(ran: Sequence[RerunTrial], version: str) -> Iterator[str]:
    """Yield which trials have no drawing: a picture of another run would be wrong."""
    missing = [again for again in ran if again.trajectory is None]
    if missing:
        yield html.paragraph(words.not_drawn(version))
        yield html.bullets(f"{again.row.algorithm}, trial {again.row.trial}: {again.why_not}" for again in missing)
