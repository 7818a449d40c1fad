"""The report of a sweep: ``report.html`` in its folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from wayfarer.experiments.provenance import RecordedRun, read_runs
from wayfarer.experiments.report import words
from wayfarer.experiments.report.escape_figure import colour_of
from wayfarer.experiments.report.sweep_figures import curves_figures, maps_figures
from wayfarer.experiments.report.sweep_results import SweepResults, read_sweep
from wayfarer.experiments.statistics import MEASURES, spl_difference
from wayfarer.views.page import html
from wayfarer.views.page.frame import PAGE, write_page
from wayfarer.views.page.plots import Figure, Plots

PAIRED = "All points met the same forests and noise, so they can be compared trial by trial."
SPL = (
    "SPL: mean over all trials of shortest path divided by path driven, a failure counting 0. The last column is the "
    "mean difference of a trial's SPL to the same trial without a sweep."
)
NO_SPL = "SPL is not known: run the sweep with --spl."
CURVES = "Bands: 95 % intervals. Broken line: the value without a sweep."
MAPS = "Colours mean the same for every algorithm; grey: not known."
INTERVALS = (
    "Intervals are at 95 %: Wilson's for shares, 1.96 standard errors for means. Success: the rover reached the line, "
    "or left the map over another edge; path and time: mean of the successes; interventions: mean of all trials."
)


def write_sweep_report(folder: Path, out: Path | None = None) -> Path:
    """Write the report of the sweep in ``folder``, and return the page's path: ``out``, or ``report.html`` in it.

    Raises:
        BadInput: the folder holds no finished sweep, is damaged, or cannot be written.
    """
    results, plots = read_sweep(folder), Plots()
    return write_page(folder / PAGE, _title(results), list(_body(results, plots, read_runs(folder))), plots, out=out)


def _body(results: SweepResults, plots: Plots, runs: Sequence[RecordedRun]) -> Iterator[str]:
    swept = [(axis.key, f"{', '.join(map(str, axis.values))} (without a sweep: {axis.now})") for axis in results.axes]
    yield html.facts([*swept, *words.facts(results.settings.campaign, runs)])
    if len(results.axes) == 2:
        for name in results.algorithms:
            caption = f"{MAPS} {_ends(results, name)}."
            yield html.section(name, html.paragraph(caption), _panels(maps_figures(results, name), plots))
    else:
        ends = "; ".join(_ends(results, name) for name in results.algorithms)
        caption = f"{CURVES} {ends}."
        key = html.layers(
            "Show", [html.PlotLayer(name, name, colour_of(at)) for at, name in enumerate(results.algorithms)]
        )
        yield html.section("What changes", html.paragraph(caption), key, _panels(curves_figures(results), plots))
    texts = [INTERVALS, PAIRED, SPL if results.has_spl else NO_SPL]
    yield html.section("Each point", _table(results), *map(html.paragraph, texts))


def _panels(figures: Iterable[Figure], plots: Plots) -> str:
    return html.panels(html.figure(plots.place(figure)) for figure in figures)


def _ends(results: SweepResults, name: str) -> str:
    """Say in words how far an algorithm's success goes."""
    found = [MEASURES[0].of(results.cells[point, name]) for point in range(len(results.points))]
    shares = [estimate.value for estimate in found if estimate]
    return f"{name}: success from {min(shares):.1f} to {max(shares):.1f} %"


def point_titles(results: SweepResults) -> list[str]:
    """Return the titles of the table of all points."""
    return [
        "algorithm",
        *(axis.key for axis in results.axes),
        *(measure.title for measure in results.measures),
        *(["SPL, difference"] if results.has_spl else []),
    ]


def point_rows(results: SweepResults, name: str) -> Iterator[list[str]]:
    """Yield the cells of an algorithm's row at each point, from the second column on."""
    for point, values in enumerate(results.points):
        rows = results.cells[point, name]
        found = ((measure.of(rows), measure.decimals) for measure in results.measures)
        cells = ["" if estimate is None else estimate.text(decimals) for estimate, decimals in found]
        if results.has_spl:
            others = None if results.now in {None, point} else results.cells[results.now, name]
            difference = spl_difference(rows, others) if others else None
            cells.append("" if difference is None else difference.text(3, "+"))
        yield [*map(str, values), *cells]


def _table(results: SweepResults) -> str:
    head = point_titles(results)
    rows = []
    for name in results.algorithms:
        rows.append(("group", [name, *[""] * (len(head) - 1)]))
        rows += [("", ["", *cells]) for cells in point_rows(results, name)]
    return html.table("Value [95 % interval]", head, rows)


def _title(results: SweepResults) -> str:
    keys = " and ".join(axis.key for axis in results.axes)
    return f"Sensitivity to {keys}: {', '.join(results.algorithms)}"
