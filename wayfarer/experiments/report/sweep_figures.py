"""Figures of a sweep: over one key a curve per algorithm with 95 % intervals, over two keys a heat map per algorithm.

There is a figure for each measure.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from bokeh.models import BasicTicker, LinearColorMapper
from bokeh.models.annotations import ColorBar, Span
from bokeh.palettes import Cividis256
from bokeh.plotting import ColumnDataSource

from wayfarer.experiments.report.algorithm_rows import SVG
from wayfarer.experiments.report.escape_figure import colour_of, curve_look
from wayfarer.experiments.report.sweep_results import SweepResults, SweptAxis
from wayfarer.experiments.statistics import Estimate, Measure
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, hover, layer, plot, source

CURVES_PX, MAP_PX = 240, 300
MOST_NAMES = 8  # along an axis; of more values every n-th is named
MOST_NUMBERS = 80  # cells; with more there is no room for a number in each
UNKNOWN = Estimate(math.nan, math.nan, math.nan)


def curves_figures(results: SweepResults) -> Iterator[Figure]:
    """Yield a figure for each measure that is known; all are zoomed together along the key.

    A broken line marks the value without a sweep. Words stand side by side in the order of the sweep.
    """
    axis = results.axes[0]
    x_range: Any = {} if axis.numeric else {"x_range": [str(value) for value in axis.values]}
    for measure in results.measures:
        made = plot(
            measure.name,
            CURVES_PX,
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


def maps_figures(results: SweepResults, algorithm: str) -> Iterator[Figure]:
    """Yield a map for each measure: the first key upwards, the second to the right; colours mean the same for all."""
    up, right = results.axes
    for measure in results.measures:
        made = plot(
            f"{measure.name}, {algorithm}", MAP_PX, "both", output_backend=SVG,
            title=measure.title,
            x_range=(-0.5, len(right.values) - 0.5), y_range=(-0.5, len(up.values) - 0.5),
        )  # fmt: skip
        _name_values(made.xaxis, right)
        _name_values(made.yaxis, up)
        made.grid.visible = False
        _cells(made, results, algorithm, measure)
        yield made


def _cells(made: Figure, results: SweepResults, algorithm: str, measure: Measure) -> None:
    """Draw a cell for each point, with its number where there is room."""
    up, right = results.axes
    mapper = _colours(results, measure)
    estimates = [measure.of(results.cells[point, algorithm]) for point in range(len(results.points))]
    values = [math.nan if each is None else each.value for each in estimates]
    middle = (mapper.low + mapper.high) / 2.0
    cells = source(
        x=[point % len(right.values) for point in range(len(values))],
        y=[point // len(right.values) for point in range(len(values))],
        value=values, up=[str(point[0]) for point in results.points], right=[str(point[1]) for point in results.points],
        text=["not known" if each is None else each.text(measure.decimals) for each in estimates],
        number=["" if math.isnan(value) else f"{value:.{measure.decimals}f}" for value in values],
        ink=["white" if value < middle else "black" for value in values],  # dark colours are low
    )  # fmt: skip
    drawn = made.rect(
        "x", "y", 1.0, 1.0, source=cells, fill_color={"field": "value", "transform": mapper}, line_color=None,
        name="cells",
    )  # fmt: skip
    if len(values) <= MOST_NUMBERS:
        made.text(
            "x", "y", "number", source=cells, text_color={"field": "ink"}, text_font_size="10px", text_align="center",
            text_baseline="middle",
        )  # fmt: skip
    made.add_tools(hover([drawn], (up.key, "@up"), (right.key, "@right"), (f"{measure.title} [95 %]", "@text")))
    bar = ColorBar(
        color_mapper=mapper, width=10, padding=4, ticker=BasicTicker(desired_num_ticks=4), background_fill_color=None
    )
    made.add_layout(bar, "right")


def _colours(results: SweepResults, measure: Measure) -> Any:
    """Return colours over all values of a measure; cividis is read alike by colour-blind readers."""
    known = [each.value for rows in results.cells.values() if (each := measure.of(rows))]
    low, high = min(known), max(known)
    return LinearColorMapper(
        palette=Cividis256, low=low, high=high if high > low else low + 1.0, nan_color=palette.GREY
    )


def _name_values(axis: Any, swept: SweptAxis) -> None:
    """Name the values of a key; of many, every n-th."""
    step = -(-len(swept.values) // MOST_NAMES)
    places = list(range(0, len(swept.values), step))
    axis.ticker = places
    axis.major_label_overrides = {place: str(swept.values[place]) for place in places}
    axis.axis_label = swept.key
