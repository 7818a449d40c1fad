"""The report of a campaign: ``report.html`` in its folder."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from pathlib import Path

from wayfarer.errors import BadInput
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.measures import COMPARED, compare
from wayfarer.experiments.paper import reported
from wayfarer.experiments.provenance import RecordedRun, facts_of
from wayfarer.experiments.results import Results
from wayfarer.experiments.tables import comparison_table, result_sentences, table_of, unfinished
from wayfarer.fieldlog.wording import plural
from wayfarer.logview.terminal_table import TextTable
from wayfarer.reports.figures import escape_figure, gain_figure, grouped, paths_figure
from wayfarer.reports.page import html
from wayfarer.reports.page.html import PAGE, Plot, write_page
from wayfarer.reports.page.plots import Plots
from wayfarer.reports.worst_trials import Progress, no_progress, worst_section
from wayfarer.simhal.faults.kinds import parse_fault

ESCAPE = (
    "Share of all trials that have escaped by a path of that length; one that was entrapped, tipped or ended in a "
    "fault counts as not escaped at any length (a tick marks the longest of them). The percentage is where the "
    "curve ends, as in the table. A click on a name hides its curve."
)
CAPTION = (
    "Mean difference over the pairs of trials in the same forest with the same noise, with its 95 % interval. "
    "An interval without 0 is a difference that chance alone would seldom make."
)


def comparison_section(results: Results, plots: Plots) -> Iterator[str]:
    """Yield how the algorithms, at least two, differ from one of them; or why they cannot be compared."""
    try:
        base, *others = compare(results.rows)
    except BadInput as reason:
        yield html.paragraph(f"The trials cannot be compared: {reason}.")
        return
    yield html.paragraph(f"Against {base.algorithm}. {CAPTION}")
    known = {
        each: found
        for each in COMPARED
        if (found := {one.algorithm: change for one in others if (change := one.changes[each.name])})
    }
    yield html.panels(
        html.figure(plots.place(gain_figure(each, found)), alt=f"Difference from {base.algorithm}: {each.title}")
        for each, found in known.items()
    )
    table = comparison_table([base, *others])
    yield html.table("The table of wayfarer compare", table.titles, html.below(table.rows))
    yield html.bullets(table.notes)


def write_report(
    results: Results,
    out: Path | None = None,
    *,
    gallery: int,
    jobs: int,
    allow_code: bool = False,
    progress: Progress = no_progress,
) -> Path:
    """Write the report of a campaign's folder, and return the page's path: ``out``, or ``report.html`` in the folder.

    ``gallery`` is how many trials are drawn; they are run again for that, in ``jobs`` processes. The same folder gives
    the same bytes. ``allow_code`` as of ``recorded.rebuild``; ``progress`` gives, for a number of trials, what is to be
    called when one is done.

    Raises:
        BadInput: no trial has ended, or the page cannot be written.
        TrialNotRun: a worker process died.
    """
    plots, folder = Plots(), folder_with_rows(results)
    body = [html.paragraph(unfinished(results)), *_overview(results, plots)]
    body += worst_section(results, plots, gallery, jobs, allow_code=allow_code, progress=progress)
    body.append(html.folded("How these trials were made", html.facts(how_made(results.plan.base, results.runs))))
    return write_page(folder / PAGE, title(results), body, plots, out=out)


def folder_with_rows(results: Results) -> Path:
    """Return the folder of results that a page can be made of.

    Raises:
        BadInput: no trial has ended yet.
    """
    folder = results.folder or Path()
    if not results.rows:
        raise BadInput(f"{folder}: none of its {results.total} trials has ended yet; make the report later")
    return folder


def _overview(results: Results, plots: Plots) -> Iterator[str]:
    """Yield all sections that need no trial to be run again."""
    rows = results.by_algorithm
    yield html.result(result_sentences(results))
    yield html.section("Path length", _paths(results, plots))
    if len(rows) > 1:
        yield html.section("Paired comparison", *comparison_section(results, plots))
    escapes = html.figure(plots.place(escape_figure(rows)), ESCAPE, "Share of escaped trials by path length")
    yield html.section("Escapes by path length", escapes)
    table = table_of(results, full=True)
    heading = "Results beside the paper's" if reported(results.settings) else "Results"
    yield html.section(heading, _results_table(results, table), html.bullets(table.notes))


def _paths(results: Results, plots: Plots) -> str:
    drawn = paths_figure(results.by_algorithm, results.shortest_paths_m, reported(results.settings))
    return html.figure(plots.place(drawn), paths_caption(results), "Path length by algorithm")


def campaign_plot(results: Results) -> Plot:
    """Return the figure of the paths on its own."""
    plots = Plots()
    return Plot(title(results), [html.paragraph(unfinished(results)), _paths(results, plots)], plots)


def _results_table(results: Results, table: TextTable) -> str:
    """Return a row for each algorithm, under its group, with a row of the paper's below if the paper has one."""
    ours = [at for at, (kind, _) in enumerate(table.rows) if not kind]
    rows: list[tuple[str, Sequence[str]]] = []
    for group in grouped(list(results.by_algorithm)):
        rows.append(("group", [group.title, *[""] * (len(table.titles) - 1)]))
        for at, after in zip(ours, [*ours[1:], len(table.rows)], strict=True):  # its row, and one of the paper's
            if table.rows[at][1][0] in group.algorithms:
                rows += [(kind or "ours", cells) for kind, cells in table.rows[at:after]]
    return html.table("Value [95 % interval]", table.titles, html.below(rows))


# -- words -------------------------------------------------------------------------------------------------------------


def title(results: Results) -> str:
    """Name the page."""
    names, trials = results.plan.base.algorithms, results.plan.base.trials
    what, each = (names[0], "") if len(names) == 1 else (f"{len(names)} algorithms", " each")
    where = f" at the site {results.plan.base.site}" if results.plan.base.site else ""
    return f"{what} in {plural(trials, 'simulated forest trial')}{each}{where}"


def how_made(settings: Campaign, runs: Sequence[RecordedRun] = ()) -> Iterator[tuple[str, str]]:
    """Yield how the results were made, as far as the folder says, and everything that decides them."""
    rover, forests = settings.rover, settings.forests
    yield from facts_of(runs)
    if not runs:
        yield "software", f"wayfarer {settings.version}"
    yield "trials of each algorithm", str(settings.trials)
    if settings.site:
        yield "site", settings.site
    yield "seed", str(settings.seed)
    yield "mean distance between slips", f"{settings.slip_mean_m:g} m"
    yield "path budget", f"{settings.budget_m:g} m"
    yield "rover", str(rover.name)
    yield "obstacles noticed by", str(rover.anomaly_source)
    yield "depth of the simulation", settings.depth.value
    yield "physics", settings.physics
    if settings.physics == "light":
        yield "ground", settings.ground.value
    for key, value in settings.set.items():
        yield key, f"{value[0]:g} to {value[1]:g}, drawn for each trial" if isinstance(value, tuple) else str(value)
    if settings.faults:
        yield "faults in each trial", "; ".join(str(parse_fault(each)) for each in settings.faults)
    if not settings.site:
        yield "forests", f"{forests.name}, BLAKE2b {forests.blake2b}" if forests else "generated"
    yield "algorithms", ", ".join(settings.algorithms)


def paths_caption(results: Results) -> str:
    """Explain the figure of paths."""
    shortest_m = results.shortest_paths_m
    papers = reported(results.settings).values()
    paper = ", vermilion: the paper's (section IV)" if any("path_m" in each for each in papers) else ""
    line = f" Broken line: mean shortest path, {statistics.fmean(shortest_m):.1f} m." if shortest_m else ""
    return (
        "Path length of the successes: how many trials had which path; box with quartiles and median, whiskers to the "
        "last trial within 1.5 interquartile ranges, a ring for every trial beyond; blue diamond: mean with one "
        f"standard deviation{paper}.{line}"
    )
