"""Figures of a sweep over one key: each measure as a curve per algorithm, with 95 % intervals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from bokeh.models.annotations import Span
from bokeh.plotting import ColumnDataSource

from wayfarer.experiments.report.algorithm_rows import SVG
from wayfarer.experiments.report.escape_figure import colour_of, curve_look
from wayfarer.experiments.report.load_results import SweepResults
from wayfarer.experiments.statistics import Estimate
from wayfarer.experiments.sweep.measures import MEASURES, Measure
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, hover, layer, plot, source

PANEL_PX = 240
UNKNOWN = Estimate(math.nan, math.nan, math.nan)


def curves_figures(results: SweepResults) -> Iterator[Figure]:
    """Yield a figure for each measure that is known; all are zoomed together along the key.

    A broken line marks the value without a sweep. Words stand side by side in the order of the sweep.
    """
    axis = results.axes[0]
    x_range: Any = {} if axis.numeric else {"x_range": [str(value) for value in axis.values]}
    for measure in known_measures(results):
        made = plot(
            measure.name,
            PANEL_PX,
            "both",
            output_backend=SVG,
            title=measure.title,
            **x_range,
        )
        x_range = {"x_range": made.x_range}
        made.xaxis.axis_label, made.yaxis.axis_label = axis.key, measure.title
        for number in range(len(results.algorithms)):
            _curve(made, results, measure, number)
        if results.now is not None:
            now: Any = _places(results)[results.now]
            made.add_layout(Span(location=now, dimension="height", line_color=palette.GREY, line_dash=[4, 3]))
        yield made


def known_measures(results: SweepResults) -> list[Measure]:
    """Return the measures that some point has; SPL needs shortest paths."""
    return [measure for measure in MEASURES if any(measure.of(rows) for rows in results.cells.values())]


def _places(results: SweepResults) -> Sequence[float | str]:
    """Return where each value is along x."""
    axis = results.axes[0]
    return [float(value) if axis.numeric else str(value) for value in axis.values]


def _curve(made: Figure, results: SweepResults, measure: Measure, number: int) -> None:
    name, places = results.algorithms[number], _places(results)
    order = list(range(len(places)))
    if results.axes[0].numeric:
        order.sort(key=lambda point: places[point])
    estimates = {point: measure.of(results.cells[point, name]) for point in order}
    drawn = [estimates[point] or UNKNOWN for point in order]
    told: ColumnDataSource = source(
        x=[places[point] for point in order], key=[str(results.points[point][0]) for point in order],
        value=[each.value for each in drawn], low=[each.low for each in drawn], high=[each.high for each in drawn],
        text=[each.text(measure.decimals) if (each := estimates[point]) else "" for point in order],
    )  # fmt: skip
    colour = colour_of(number)
    band = made.varea("x", "low", "high", source=told, fill_color=colour, fill_alpha=0.18)
    line = made.line("x", "value", source=told, **curve_look(number))
    points = made.scatter("x", "value", source=told, size=6, color=colour, name=name)
    layer(name, band, line, points)
    rows = (("algorithm", "$name"), (results.axes[0].key, "@key"), (f"{measure.title} [95 %]", "@text"))
    made.add_tools(hover([points], *rows))
