"""The report of a campaign: ``report.html`` in its folder, and its figures as files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.entrapment import entrapment
from wayfarer.experiments.progress_bar import shown_progress
from wayfarer.experiments.report import words
from wayfarer.experiments.report.drawing import save
from wayfarer.experiments.report.drawn import figure, file_name, write_drawn
from wayfarer.experiments.report.escape_figure import escape_figure
from wayfarer.experiments.report.forest_figure import close_up_figure, forest_figure, legend_figure
from wayfarer.experiments.report.paths_figure import paths_figure
from wayfarer.experiments.report.ratio_figure import ratio_figure
from wayfarer.experiments.report.reading import Results, read_results
from wayfarer.experiments.report.table import causes_table, results_table
from wayfarer.experiments.report.worst_trials import RerunTrial, choose, run_again
from wayfarer.views.page import html


def write_report(folder: Path, out: Path | None = None, *, gallery: int = 12, jobs: int) -> Path:
    """Write the report of the campaign in ``folder``, and return the page's path: ``out``, or ``report.html`` in it.

    The figures stand in ``figures`` beside the page. ``gallery`` is how many trials are drawn; they are run again for
    that, in ``jobs`` processes. The same folder gives the same bytes.

    Raises:
        BadInput: the folder holds no finished campaign, is damaged, or cannot be written.
        WayfarerError: a worker process died.
    """
    results = read_results(folder)

    def body(figures: Path) -> list[str]:
        return [*_overview(results, figures), _gallery(results, figures, gallery, jobs)]

    return write_drawn(folder, out, words.title(results), body)


def _overview(results: Results, figures: Path) -> Iterator[str]:
    """Yield all sections that need no trial to be run again."""
    rows = results.by_algorithm
    paths = paths_figure(rows, results.summaries, results.shortest_paths_m)
    escape = escape_figure(rows)
    yield html.facts(words.facts(results.settings))
    yield html.section(
        "Path length and failures",
        figure(save(paths, figures, "paths", words.paths_alt(results)), words.paths_caption(results)),
    )
    yield html.section("Results beside the paper's", results_table(results), *map(html.paragraph, words.LEGEND))
    yield html.section(
        "Who has escaped by which path",
        figure(save(escape, figures, "escape", words.escape_alt(results)), words.ESCAPE_CAPTION),
    )
    yield html.section("Path over shortest path", _ratio(results, figures))


def _ratio(results: Results, figures: Path) -> str:
    if not results.shortest_paths_m:
        return html.paragraph(words.NO_SHORTEST_PATHS)
    drawing = save(ratio_figure(results.by_algorithm), figures, "ratio", words.ratio_alt(results))
    return figure(drawing, words.ratio_caption(results))


def _gallery(results: Results, figures: Path, count: int, jobs: int) -> str:
    heading = "Trials seen from above"
    rows = choose(results.by_algorithm, count)
    if not rows:
        return html.section(heading, html.paragraph(words.NOTHING_TO_DRAW))
    try:
        campaign = results.rebuild()
    except BadInput as reason:
        return html.section(heading, html.paragraph(words.no_gallery(reason)))
    with shown_progress(Console(stderr=True), 0, Counter(row.algorithm for row in rows), jobs) as progress:
        ran = run_again(campaign, rows, jobs, progress)
    drawn = html.section(heading, *_drawn(campaign, ran, figures), *_not_drawn(ran, results.settings.version))
    return "\n".join([drawn, *_entrapped(campaign, ran, figures)])


def _drawn(campaign: Campaign, ran: Sequence[RerunTrial], figures: Path) -> Iterator[str]:
    """Yield the drawings of the trials that came out as in the table."""
    drawn = [(again.row, again.trace) for again in ran if again.trace is not None]
    if not drawn:
        return
    yield html.paragraph(words.GALLERY)
    yield figure(save(legend_figure(), figures, "forest-legend", words.FOREST_LEGEND_ALT), words.FOREST_LEGEND)
    yield '<div class="gallery">'
    for row, trace in drawn:
        picture = forest_figure(campaign.make_forest(row.trial), trace)
        name, alt = file_name("forest", row.algorithm, row.trial), words.trial_alt(row, len(trace.slips_m))
        drawing = save(picture, figures, name, alt)
        yield figure(drawing, words.trial_caption(row), "forest")
    yield "</div>"


def _entrapped(campaign: Campaign, ran: Sequence[RerunTrial], figures: Path) -> Iterator[str]:
    """Yield the section that says why trials were entrapped, with what is around the place of each."""
    seen = [
        (again.row, again.trace, entrapment(campaign.make_forest(again.row.trial), campaign.rover, again.trace))
        for again in ran
        if again.trace is not None and again.row.outcome == "entrapped"
    ]
    if not seen:
        return
    parts = [html.paragraph(words.ENTRAPPED), causes_table([(row.algorithm, found.why) for row, _, found in seen])]
    parts.append('<div class="gallery">')
    for row, trace, found in seen:
        picture = close_up_figure(campaign.make_forest(row.trial), trace, found.middle_m, found.extent_m)
        name, caption = file_name("entrapped", row.algorithm, row.trial), words.entrapped_caption(row, found)
        parts.append(figure(save(picture, figures, name, caption), caption, "forest"))
    yield html.section("Why trials were entrapped", *parts, "</div>")


def _not_drawn(ran: Sequence[RerunTrial], version: str) -> Iterator[str]:
    """Yield which trials have no drawing: a picture of another run would be wrong."""
    missing = [again for again in ran if again.trace is None]
    if missing:
        yield html.paragraph(words.not_drawn(version))
        yield html.bullets(f"{again.row.algorithm}, trial {again.row.trial}: {again.why_not}" for again in missing)
