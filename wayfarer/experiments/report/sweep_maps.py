"""Figures of a sweep over two keys: heat maps of an algorithm, one for each measure."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from bokeh.models import BasicTicker, LinearColorMapper
from bokeh.models.annotations import ColorBar
from bokeh.palettes import Cividis256

from wayfarer.experiments.report.algorithm_rows import SVG
from wayfarer.experiments.report.load_results import SweepResults, SweptAxis
from wayfarer.experiments.report.sweep_curves import known_measures
from wayfarer.experiments.sweep.measures import Measure
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, hover, plot, source

PANEL_PX = 300
MOST_NAMES = 8  # along an axis; of more values every so manieth is named
MOST_NUMBERS = 80  # cells; with more there is no room for a number in each


def maps_figures(results: SweepResults, algorithm: str) -> Iterator[Figure]:
    """Yield a map for each measure: the first key upwards, the second to the right; colours mean the same for all."""
    up, right = results.axes
    for measure in known_measures(results):
        made = plot(
            f"{measure.name}, {algorithm}", PANEL_PX, "both", output_backend=SVG,
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
    """Name the values of a key; of many, every so manieth."""
    step = -(-len(swept.values) // MOST_NAMES)
    places = list(range(0, len(swept.values), step))
    axis.ticker = places
    axis.major_label_overrides = {place: str(swept.values[place]) for place in places}
    axis.axis_label = swept.key
