"""The report of a campaign: ``report.html`` in its folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from math import radians
from pathlib import Path

import msgspec
import numpy as np
from bokeh.models import Range1d
from bokeh.models.annotations import Span

from wayfarer.errors import BadInput
from wayfarer.escape.api import Phase
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.measures import COMPARED, Estimate, Measure, compare
from wayfarer.experiments.paper import reported
from wayfarer.experiments.report import words
from wayfarer.experiments.report.paths_figure import SVG, escape_figure, grouped, lay_out, paths_figure, rows_plot
from wayfarer.experiments.report.worst_trials import RerunTrial, Trajectory, TrajectoryPoint, choose, run_again
from wayfarer.experiments.results import Results
from wayfarer.experiments.tables import campaign_table, comparison_table, sentences
from wayfarer.fieldlog.record import World
from wayfarer.logview import palette
from wayfarer.logview.terminal_table import TextTable
from wayfarer.reports.data import EDGE, Floats, pieces
from wayfarer.reports.map import draw_forest
from wayfarer.reports.page import html
from wayfarer.reports.page.frame import PAGE, write_page
from wayfarer.reports.page.plots import Figure, Plots, hover, layer, plot, source
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.forest_file import as_row
from wayfarer.vocabulary import in_words

# -- comparison ------------------------------------------------------------------------------------------------------
# The paired comparison of a campaign's algorithms: forest plots, table and words of ``wayfarer compare``.

ROW_PX = 34
ROOM = 0.06  # of the axis, beside the first and the last interval
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
        html.figure(plots.place(gain_figure(each, found)), alt=f"Difference to {base.algorithm}: {each.title}")
        for each, found in known.items()
    )
    table = comparison_table([base, *others])
    rows = [(kind, list(map(_below, cells))) for kind, cells in table.rows]
    yield html.table("The table of wayfarer compare", table.titles, rows)
    yield from map(html.paragraph, sentences([base, *others]))
    yield html.bullets(table.notes)


def gain_figure(measure: Measure, found: dict[str, Estimate]) -> Figure:
    """Return a forest plot: an algorithm a row, its mean difference with the 95 % interval, and a line at 0."""
    layout = lay_out(grouped(found))
    ends = {name: each.ends for name, each in found.items()}
    low, high = min(0.0, *(each[0] for each in ends.values())), max(0.0, *(each[1] for each in ends.values()))
    room = ROOM * (high - low) or 1.0
    better = "right: better" if measure.better == "more" else "left: better"
    label = f"{measure.title}{measure.points and f', {measure.points}'} ({better})"
    made = rows_plot(f"comparison, {measure.title}", layout, ROW_PX, label, low - room, high + room)
    made.add_layout(Span(location=0.0, dimension="height", line_color=palette.GREY, line_dash=[5, 3]))
    points = source(
        algorithm=list(found), y=[layout.at[name] for name in found], pairs=[each.trials for each in found.values()],
        mean=[each.value for each in found.values()], low=[each[0] for each in ends.values()],
        high=[each[1] for each in ends.values()],
        text=[each.text(measure.decimals, "+") for each in found.values()],
    )  # fmt: skip
    line = made.segment("low", "y", "high", "y", source=points, line_color=palette.BLUE, line_width=3)
    mean = made.scatter("mean", "y", source=points, marker="square", size=9, color=palette.BLUE, name=measure.name)
    told = (("algorithm", "@algorithm"), ("difference [95 %]", "@text"), ("pairs", "@pairs"))
    made.add_tools(hover([line, mean], *told))
    return made


SLIPS = html.PlotLayer("slips", "Slips", palette.ANOMALY)
PLACE = (("east", "@x{0.0} m"), ("north", "@y{0.0} m"))
AFTER = ("after", "@t_s{0} s")
CLOSE_M = 20.0  # to the goal line
GALLERY_TRIALS = 6


Progress = Callable[[int], AbstractContextManager[Callable[[object], object]]]


def no_progress(_trials: int) -> AbstractContextManager[Callable[[object], object]]:
    """Show no progress."""
    return nullcontext(lambda _done: None)


def write_report(
    results: Results,
    out: Path | None = None,
    *,
    gallery: int = GALLERY_TRIALS,
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
    body = [*words.unfinished(results), *_overview(results, plots)]
    body += _worst(results, plots, gallery, jobs, allow_code=allow_code, progress=progress)
    body.append(html.folded("How these trials were made", html.facts(words.facts(results.plan.base, results.runs))))
    return write_page(folder / PAGE, words.title(results), body, plots, out=out)


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
    rows, papers = results.by_algorithm, reported(results.settings)

    def drawn(figure: Figure, caption: str = "", alt: str = "") -> str:
        return html.figure(plots.place(figure), caption, alt)

    yield html.result(words.result_sentences(results))
    yield html.section(
        "Path length",
        drawn(
            paths_figure(rows, results.shortest_paths_m, papers),
            words.paths_caption(results),
            "Path length by algorithm",
        ),
    )
    if len(rows) > 1:
        yield html.section("Paired comparison", *comparison_section(results, plots))
    yield html.section(
        "Escapes by path length",
        drawn(escape_figure(rows), words.ESCAPE, "Share of escaped trials by path length"),
    )
    table = campaign_table(rows, papers, site=results.plan.base.site is not None, full=True)
    heading = "Results beside the paper's" if papers else "Results"
    yield html.section(heading, _results_table(results, table), html.bullets(table.notes))


def _results_table(results: Results, table: TextTable) -> str:
    """Return a row for each algorithm, under its group, with a row of the paper's below if the paper has one."""
    ours = [at for at, (kind, _) in enumerate(table.rows) if not kind]
    rows: list[tuple[str, Sequence[str]]] = []
    for group in grouped(list(results.by_algorithm)):
        rows.append(("group", [group.title, *[""] * (len(table.titles) - 1)]))
        for at, after in zip(ours, [*ours[1:], len(table.rows)], strict=True):  # its row, and one of the paper's
            if table.rows[at][1][0] in group.algorithms:
                rows += [(kind or "ours", list(map(_below, cells))) for kind, cells in table.rows[at:after]]
    return html.table("Value [95 % interval]", table.titles, rows)


def _below(cell: str) -> str:
    """Put an interval below its value, so that all columns have room."""
    return cell.strip().replace(" [", "\n[")


def _worst(
    results: Results, plots: Plots, count: int, jobs: int, *, allow_code: bool, progress: Progress
) -> Iterator[str]:
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
    with progress(len(rows)) as advance:
        ran = run_again(campaign, rows, jobs, advance)
    yield html.section(
        heading, *_gallery(campaign, ran, plots, len(results.rows)), *_not_drawn(ran, results.plan.base.version)
    )


def _gallery(campaign: Campaign, ran: Sequence[RerunTrial], plots: Plots, trials: int) -> Iterator[str]:
    """Yield the maps of the trials beside each other, under one key for all."""
    maps = []
    for row, trajectory, _ in ran:
        if trajectory is not None:
            drawn = trial_map(f"{row.algorithm}-{row.trial}", campaign.make_forest(row.trial), trajectory)
            maps.append(html.figure(plots.place(drawn), words.trial_text(row, len(trajectory.slips_m))))
    if maps:
        yield html.paragraph(f"{len(ran)} of {trials:,} trials. {words.GALLERY}")
        yield html.layers("Show", [*html.phase_layers(), SLIPS])
        yield html.panels(maps)


def _not_drawn(ran: Sequence[RerunTrial], version: str) -> Iterator[str]:
    """Yield which trials have no drawing: a picture of another run would be wrong."""
    missing = [again for again in ran if again.trajectory is None]
    if missing:
        yield html.paragraph(words.not_drawn(version))
        yield html.bullets(f"{again.row.algorithm}, trial {again.row.trial}: {again.why_not}" for again in missing)


# -- the map of one trial: its forest, its true path by phases, slips, start and end -----------------------------------


def trial_map(name: str, forest: Forest, trajectory: Trajectory) -> Figure:
    """Return the map of a trial, metres, north up; ``name`` is the figure's."""
    made = plot(name, None, "map", output_backend=SVG, sizing_mode="scale_width", aspect_ratio=1.0, match_aspect=True)
    made.xaxis.axis_label, made.yaxis.axis_label = "east, m", "north, m"
    if forest.goal_y_m - forest.start_m[1] < CLOSE_M:  # at a site: all of the map would show the clutter as a dot
        half_m = CLOSE_M / 2.0 + 1.0
        made.x_range, made.y_range = (Range1d(start=at - half_m, end=at + half_m) for at in forest.start_m)
    draw_forest(made, msgspec.convert(as_row(forest), World))
    for phase in Phase:
        if phase.value in palette.PHASE_COLOURS:
            x_m, y_m, t_s = path_in(trajectory.points, phase)
            line = made.line(
                "x", "y", source=source(x=x_m, y=y_m, t_s=t_s), line_color=palette.PHASE_COLOURS[phase.value],
                line_width=2, line_join="round",
            )  # fmt: skip
            layer(phase.value, line)
            made.add_tools(hover([line], ("phase", in_words(phase.value)), AFTER, *PLACE, line_policy="nearest"))
    x_m, y_m = np.reshape(trajectory.slips_m, (-1, 2)).T
    slips = made.scatter("x", "y", source=source(x=x_m, y=y_m), size=6, fill_color=palette.ANOMALY, **EDGE)
    layer("slips", slips)
    made.add_tools(hover([slips], ("slip", "the ground gave way"), *PLACE))
    _mark_ends(made, forest, trajectory.points[-1])
    return made


def path_in(points: Sequence[TrajectoryPoint], phase: Phase) -> list[Floats]:
    """Return x, y and time of a path in a phase as one line with gaps; each part ends where the next phase begins."""
    columns = (np.array([getattr(point, name) for point in points]) for name in ("x_m", "y_m", "t_s"))
    return pieces(np.array([point.phase is phase for point in points]), *columns)


def _mark_ends(made: Figure, forest: Forest, last: TrajectoryPoint) -> None:
    """Mark the start with a triangle that points to the goal, and the end with a cross."""
    x_m, y_m = forest.start_m
    start = made.scatter(
        "x", "y", source=source(x=[x_m], y=[y_m]), marker="triangle", size=15, fill_color=palette.GOAL_LINE,
        angle=-radians(forest.heading_deg), **EDGE,
    )  # fmt: skip
    ended = source(x=[last.x_m], y=[last.y_m], t_s=[last.t_s])
    end = made.scatter("x", "y", source=ended, marker="x", size=13, line_width=4, line_color=palette.VERMILION)
    made.add_tools(hover([start], ("start", "points to the goal"), *PLACE), hover([end], ("end", ""), AFTER, *PLACE))
