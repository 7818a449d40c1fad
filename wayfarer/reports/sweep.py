"""The report of a sweep: ``report.html`` in its folder."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from bokeh.models import BasicTicker, LinearColorMapper
from bokeh.models.annotations import ColorBar, Span
from bokeh.palettes import Cividis256
from bokeh.plotting import ColumnDataSource

from wayfarer.experiments.campaign import Axis
from wayfarer.experiments.measures import MEASURES, WHAT_COUNTS, Estimate, Measure, difference, estimate
from wayfarer.experiments.results import Results
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.tables import (
    INTERVAL,
    NO_SPL,
    SWEEP_COLUMNS,
    layouts_note,
    layouts_of_points,
    methods_note,
    unfinished,
)
from wayfarer.logview import palette
from wayfarer.reports.campaign import folder_with_rows, how_made
from wayfarer.reports.figures import SVG, colour_of, curve_look
from wayfarer.reports.page import html
from wayfarer.reports.page.frame import PAGE, Plot, write_page
from wayfarer.reports.page.plots import Figure, Plots, hover, layer, plot, source

# -- figures ---------------------------------------------------------------------------------------------------------
# Figures of a sweep: over one key a curve per algorithm with 95 % intervals, over two keys a heat map per algorithm.
#
# There is a figure for each measure.

CURVES_PX, MAP_PX = 240, 300
MOST_NAMES = 8  # along an axis; of more values every n-th is named
MOST_NUMBERS = 80  # cells; with more there is no room for a number in each
NAN = math.nan


class Grid:
    """What the page of a sweep shows: estimates at each point, of each algorithm; None if no trial has ended there."""

    def __init__(self, results: Results) -> None:
        self.all, self.axes, self.algorithms = results, results.plan.axes, results.plan.base.algorithms
        self.points = [tuple(values.values()) for values in results.swept]
        self._cells = {(point, name): list[TrialRow]() for point in range(len(self.points)) for name in self.algorithms}
        self._cells |= results.cells
        self.estimates: dict[str, dict[tuple[int, str], Estimate | None]] = {
            each.name: {cell: estimate(rows, MEASURES[each.name]) for cell, rows in self._cells.items()}
            for each in SWEEP_COLUMNS
        }
        # Those that some point has: SPL needs shortest paths, some things never happen.
        self.measures = [
            MEASURES[each.name]
            for each in SWEEP_COLUMNS
            if any(one and (one.value or each.when != "if_any") for one in self.estimates[each.name].values())
        ]
        # The point that is the campaign as it is without a sweep, None if no point is.
        values = tuple(axis.now for axis in self.axes)
        self.now = next((number for number, point in enumerate(self.points) if point == values), None)
        self._layouts = layouts_of_points(results)

    def change(self, point: int, algorithm: str) -> Estimate | None:
        """Return the difference in SPL to the same trials without a sweep; None if these met other layouts."""
        if self.now in {None, point} or self._layouts[point] != self._layouts[self.now or 0]:
            return None
        return difference(self._cells[point, algorithm], self._cells[self.now or 0, algorithm], MEASURES["spl"])


def curves_figures(results: Grid) -> Iterator[Figure]:
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
            title=measure.heading,
            **x_range,
        )
        x_range = {"x_range": made.x_range}
        made.xaxis.axis_label, made.yaxis.axis_label = axis.key, measure.heading
        for number in range(len(results.algorithms)):
            _curve(made, results, measure, number)
        if results.now is not None:
            now: Any = _places(results)[results.now]
            made.add_layout(Span(location=now, dimension="height", line_color=palette.GREY, line_dash=[4, 3]))
        yield made


def _places(results: Grid) -> Sequence[float | str]:
    """Return where each value is along x."""
    axis = results.axes[0]
    return [float(value) if axis.numeric else str(value) for value in axis.values]


def _curve(made: Figure, results: Grid, measure: Measure, number: int) -> None:
    name, places = results.algorithms[number], _places(results)
    order = list(range(len(places)))
    if results.axes[0].numeric:
        order.sort(key=lambda point: places[point])
    estimates = {point: results.estimates[measure.name][point, name] for point in order}
    ends = [(each.value, *each.ends) if (each := estimates[point]) else (NAN, NAN, NAN) for point in order]
    value, low, high = zip(*ends, strict=True)
    told: ColumnDataSource = source(
        x=[places[point] for point in order], key=[str(results.points[point][0]) for point in order],
        value=value, low=low, high=high,
        text=[each.text(measure.decimals) if (each := estimates[point]) else "" for point in order],
    )  # fmt: skip
    colour = colour_of(number)
    band = made.varea("x", "low", "high", source=told, fill_color=colour, fill_alpha=0.18)
    line = made.line("x", "value", source=told, **curve_look(number))
    points = made.scatter("x", "value", source=told, size=6, color=colour, name=name)
    layer(name, band, line, points)
    rows = (("algorithm", "$name"), (results.axes[0].key, "@key"), (f"{measure.heading} {INTERVAL}", "@text"))
    made.add_tools(hover([points], *rows))


def maps_figures(results: Grid, algorithm: str) -> Iterator[Figure]:
    """Yield a map for each measure: the first key upwards, the second to the right; colours mean the same for all."""
    up, right = results.axes
    for measure in results.measures:
        made = plot(
            f"{measure.name}, {algorithm}", MAP_PX, "both", output_backend=SVG,
            title=measure.heading,
            x_range=(-0.5, len(right.values) - 0.5), y_range=(-0.5, len(up.values) - 0.5),
        )  # fmt: skip
        _name_values(made.xaxis, right)
        _name_values(made.yaxis, up)
        made.grid.visible = False
        _cells(made, results, algorithm, measure)
        yield made


def _cells(made: Figure, results: Grid, algorithm: str, measure: Measure) -> None:
    """Draw a cell for each point, with its number where there is room."""
    up, right = results.axes
    mapper = _colours(results, measure)
    estimates = [results.estimates[measure.name][point, algorithm] for point in range(len(results.points))]
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
    made.add_tools(hover([drawn], (up.key, "@up"), (right.key, "@right"), (f"{measure.heading} {INTERVAL}", "@text")))
    if len(set(values)) > 1:
        bar = ColorBar(
            color_mapper=mapper, width=10, padding=4, ticker=BasicTicker(desired_num_ticks=4),
            background_fill_color=None, major_label_text_color=palette.GREY,  # to be read on a dark page too
        )  # fmt: skip
        made.add_layout(bar, "right")


def _colours(results: Grid, measure: Measure) -> Any:
    """Return colours over all values of a measure; cividis is read alike by colour-blind readers."""
    known = [each.value for each in results.estimates[measure.name].values() if each]
    low, high = min(known), max(known)
    return LinearColorMapper(
        palette=Cividis256, low=low, high=high if high > low else low + 1.0, nan_color=palette.GREY
    )


def _name_values(axis: Any, swept: Axis) -> None:
    """Name the values of a key; of many, every n-th."""
    step = -(-len(swept.values) // MOST_NAMES)
    places = list(range(0, len(swept.values), step))
    axis.ticker = places
    axis.major_label_overrides = {place: str(swept.values[place]) for place in places}
    axis.axis_label = swept.key


CHANGE = "SPL change\nto no sweep"
CURVES = "Bands: 95 % intervals. Broken line: the value without a sweep."
MAPS = "Colours mean the same for every algorithm; grey: not known."


def write_sweep_report(results: Results, out: Path | None = None) -> Path:
    """Write the report of a sweep's folder, and return the page's path: ``out``, or ``report.html`` in the folder.

    Raises:
        BadInput: no trial has ended, or the page cannot be written.
    """
    plots, folder, grid = Plots(), folder_with_rows(results), Grid(results)
    body = [html.paragraph(unfinished(results)), *_body(grid, plots)]
    return write_page(folder / PAGE, _title(grid), body, plots, out=out)


def _body(results: Grid, plots: Plots) -> Iterator[str]:
    swept = [(axis.key, f"{', '.join(map(str, axis.values))} (without a sweep: {axis.now})") for axis in results.axes]
    yield html.result(result_sentences(results))
    yield from _figures(results, plots)
    estimates = [each for cells in results.estimates.values() for each in cells.values()]
    change = "SPL change: to the same trials without a sweep." if _has_spl(results) else f"{NO_SPL}."
    texts = [WHAT_COUNTS, change, layouts_note(results.all), methods_note(estimates)]
    yield html.section("Each point", _table(results), *map(html.paragraph, texts))
    facts = html.facts([*swept, *how_made(results.all.plan.base, results.all.runs)])
    yield html.folded("How these trials were made", facts)


def sweep_plot(results: Results) -> Plot:
    """Return the curves or the maps on their own."""
    plots, grid = Plots(), Grid(results)
    return Plot(_title(grid), [html.paragraph(unfinished(results)), *_figures(grid, plots)], plots)


def _figures(results: Grid, plots: Plots) -> Iterator[str]:
    if len(results.axes) == 2:
        for name in results.algorithms:
            yield html.section(name, html.paragraph(MAPS), _panels(maps_figures(results, name), plots))
    else:
        key = html.layers(
            "Show", [html.PlotLayer(name, name, colour_of(at)) for at, name in enumerate(results.algorithms)]
        )
        yield html.section("What changes", html.paragraph(CURVES), key, _panels(curves_figures(results), plots))


def _panels(figures: Iterable[Figure], plots: Plots) -> str:
    return html.panels(html.figure(plots.place(figure)) for figure in figures)


def result_sentences(results: Grid) -> Iterator[str]:
    """Yield for each algorithm how far its success goes, and at which point it is best, with the interval there."""
    by = MEASURES["spl"] if _has_spl(results) else MEASURES["path_m"]
    for name in results.algorithms:
        shares = [each.value for (_, own), each in results.estimates["success_percent"].items() if each and own == name]
        if not shares:
            yield f"{name}: no trial has ended."
            continue
        text = f"{name}: success from {min(shares):.1f} to {max(shares):.1f} %"
        found = {at: each for (at, own), each in results.estimates[by.name].items() if each and own == name}
        if found:
            words = ("lowest", "highest") if by.name == "spl" else ("shortest", "longest")
            for pick, word in zip((min, max), words, strict=True):
                at = pick(found, key=lambda point: found[point].value)
                where = ", ".join(f"{a.key}={value}" for a, value in zip(results.axes, results.points[at], strict=True))
                text += f"; {by.title} is {word} at {where}: {found[at].text(by.decimals)}{by.unit and f' {by.unit}'}"
        yield f"{text} (95 % intervals)."


def _has_spl(results: Grid) -> bool:
    return any(measure.name == "spl" for measure in results.measures)


def point_titles(results: Grid) -> list[str]:
    """Return the titles of the table of all points."""
    return [
        "algorithm",
        *(axis.key for axis in results.axes),
        *(f"{measure.heading}\n{INTERVAL}" for measure in results.measures),
        *([CHANGE] if _has_spl(results) else []),
    ]


def point_rows(results: Grid, name: str) -> Iterator[list[str]]:
    """Yield the cells of an algorithm's row at each point, from the second column on."""
    for point, values in enumerate(results.points):
        found = [(results.estimates[measure.name][point, name], measure.decimals) for measure in results.measures]
        cells = ["" if each is None else each.text(decimals) for each, decimals in found]
        if _has_spl(results):
            change = results.change(point, name)
            cells.append("" if change is None else change.text(3, "+"))
        yield [*map(str, values), *cells]


def _table(results: Grid) -> str:
    head = point_titles(results)
    rows = []
    for name in results.algorithms:
        rows.append(("group", [name, *[""] * (len(head) - 1)]))
        rows += [("", ["", *cells]) for cells in point_rows(results, name)]
    return html.table("Value [95 % interval]", head, html.below(rows))


def _title(results: Grid) -> str:
    keys = " and ".join(axis.key for axis in results.axes)
    return f"Sensitivity to {keys}: {', '.join(results.algorithms)}"
