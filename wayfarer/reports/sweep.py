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
from wayfarer.reports.page.html import PAGE, Plot, write_page
from wayfarer.reports.page.plots import Figure, Plots, hover, layer, plot, source

# -- figures ---------------------------------------------------------------------------------------------------------
# One for each measure: over one key a curve per algorithm with 95 % intervals, over two keys a heat map per algorithm.

CURVES_PX, MAP_PX = 240, 300
MOST_NAMES = 8  # along an axis; of more values every n-th is named
MOST_NUMBERS = 80  # cells; with more there is no room for a number in each
NAN = math.nan


class Grid:
    """What the page of a sweep shows: estimates at each point, of each algorithm; None if no trial has ended there."""

    def __init__(self, results: Results) -> None:
        self.results, self.axes, self.algorithms = results, results.plan.axes, results.plan.base.algorithms
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


def curves_figures(grid: Grid) -> Iterator[Figure]:
    """Yield a figure for each measure that is known; all are zoomed together along the key.

    A broken line marks the value without a sweep. Words stand side by side in the order of the sweep.
    """
    axis = grid.axes[0]
    x_range: Any = {} if axis.numeric else {"x_range": [str(value) for value in axis.values]}
    for measure in grid.measures:
        made = plot(measure.name, CURVES_PX, "both", output_backend=SVG, title=measure.heading, **x_range)
        x_range = {"x_range": made.x_range}
        made.xaxis.axis_label = axis.key
        for number in range(len(grid.algorithms)):
            _curve(made, grid, measure, number)
        if grid.now is not None:
            now: Any = _places(grid)[grid.now]
            made.add_layout(Span(location=now, dimension="height", line_color=palette.GREY, line_dash=[4, 3]))
        yield made


def _places(grid: Grid) -> Sequence[float | str]:
    """Return where each value is along x."""
    axis = grid.axes[0]
    return [float(value) if axis.numeric else str(value) for value in axis.values]


def _curve(made: Figure, grid: Grid, measure: Measure, number: int) -> None:
    name, places = grid.algorithms[number], _places(grid)
    order = list(range(len(places)))
    if grid.axes[0].numeric:
        order.sort(key=lambda point: places[point])
    estimates = {point: grid.estimates[measure.name][point, name] for point in order}
    ends = [(each.value, *each.ends) if (each := estimates[point]) else (NAN, NAN, NAN) for point in order]
    value, low, high = zip(*ends, strict=True)
    told: ColumnDataSource = source(
        x=[places[point] for point in order], key=[str(grid.points[point][0]) for point in order],
        value=value, low=low, high=high,
        text=[each.text(measure.decimals) if (each := estimates[point]) else "" for point in order],
    )  # fmt: skip
    colour = colour_of(number)
    band = made.varea("x", "low", "high", source=told, fill_color=colour, fill_alpha=0.18)
    line = made.line("x", "value", source=told, **curve_look(number))
    points = made.scatter("x", "value", source=told, size=6, color=colour, name=name)
    layer(name, band, line, points)
    rows = (("algorithm", "$name"), (grid.axes[0].key, "@key"), (f"{measure.heading} {INTERVAL}", "@text"))
    made.add_tools(hover([points], *rows))


def maps_figures(grid: Grid, algorithm: str) -> Iterator[Figure]:
    """Yield a map for each measure: the first key upwards, the second to the right; colours mean the same for all."""
    up, right = grid.axes
    for measure in grid.measures:
        made = plot(
            f"{measure.name}, {algorithm}", MAP_PX, "both", output_backend=SVG,
            title=measure.heading,
            x_range=(-0.5, len(right.values) - 0.5), y_range=(-0.5, len(up.values) - 0.5),
        )  # fmt: skip
        _name_values(made.xaxis, right)
        _name_values(made.yaxis, up)
        made.grid.visible = False
        _cells(made, grid, algorithm, measure)
        yield made


def _cells(made: Figure, grid: Grid, algorithm: str, measure: Measure) -> None:
    """Draw a cell for each point, with its number if there is room."""
    up, right = grid.axes
    mapper = _colours(grid, measure)
    estimates = [grid.estimates[measure.name][point, algorithm] for point in range(len(grid.points))]
    values = [math.nan if each is None else each.value for each in estimates]
    middle = (mapper.low + mapper.high) / 2.0
    cells = source(
        x=[point % len(right.values) for point in range(len(values))],
        y=[point // len(right.values) for point in range(len(values))],
        value=values, up=[str(point[0]) for point in grid.points], right=[str(point[1]) for point in grid.points],
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


def _colours(grid: Grid, measure: Measure) -> Any:
    """Return colours over all values of a measure; cividis is read alike by colour-blind readers."""
    known = [each.value for each in grid.estimates[measure.name].values() if each]
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


CHANGE = "SPL change from\nthe default"
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


def _body(grid: Grid, plots: Plots) -> Iterator[str]:
    swept = [(axis.key, f"{', '.join(map(str, axis.values))} (without a sweep: {axis.now})") for axis in grid.axes]
    yield html.result(result_sentences(grid))
    yield from _figures(grid, plots)
    estimates = [each for cells in grid.estimates.values() for each in cells.values()]
    change = "SPL change: to the same trials without a sweep." if _has_spl(grid) else NO_SPL
    texts = [WHAT_COUNTS, change, layouts_note(grid.results), methods_note(estimates)]
    yield html.section("Each point", _table(grid), *map(html.paragraph, texts))
    facts = html.facts([*swept, *how_made(grid.results.plan.base, grid.results.runs)])
    yield html.folded("How these trials were made", facts)


def sweep_plot(results: Results) -> Plot:
    """Return the curves or the maps on their own."""
    plots, grid = Plots(), Grid(results)
    return Plot(_title(grid), [html.paragraph(unfinished(results)), *_figures(grid, plots)], plots)


def _figures(grid: Grid, plots: Plots) -> Iterator[str]:
    if len(grid.axes) == 2:
        for name in grid.algorithms:
            yield html.section(name, html.paragraph(MAPS), _panels(maps_figures(grid, name), plots, "heat-maps"))
    else:
        layers = [html.PlotLayer(name, name, colour_of(at)) for at, name in enumerate(grid.algorithms)]
        key = [html.layers("Show", layers)] if len(layers) > 1 else []
        yield html.section("What changes", html.paragraph(CURVES), *key, _panels(curves_figures(grid), plots))


def _panels(figures: Iterable[Figure], plots: Plots, kind: str = "") -> str:
    return html.panels((html.figure(plots.place(figure)) for figure in figures), kind)


def result_sentences(grid: Grid) -> Iterator[str]:
    """Yield for each algorithm the span of its success, and at which point it is best, with the interval there."""
    by = MEASURES["spl"] if _has_spl(grid) else MEASURES["path_m"]
    for name in grid.algorithms:
        shares = [each.value for (_, own), each in grid.estimates["success_percent"].items() if each and own == name]
        if not shares:
            yield f"{name}: no trial has ended."
            continue
        text = f"{name}: success {' to '.join(dict.fromkeys(f'{each:.1f}' for each in (min(shares), max(shares))))} %"
        found = {at: each for (at, own), each in grid.estimates[by.name].items() if each and own == name}
        if found:
            words = ("lowest", "highest") if by.name == "spl" else ("shortest", "longest")
            for pick, word in zip((min, max), words, strict=True):
                at = pick(found, key=lambda point: found[point].value)
                where = ", ".join(f"{a.key}={value}" for a, value in zip(grid.axes, grid.points[at], strict=True))
                text += f"; {by.title} is {word} at {where}: {found[at].text(by.decimals)}{by.unit and f' {by.unit}'}"
        yield f"{text} (95 % intervals)."


def _has_spl(grid: Grid) -> bool:
    return any(measure.name == "spl" for measure in grid.measures)


def point_titles(grid: Grid) -> list[str]:
    """Return the titles of the table of all points."""
    return [
        "algorithm",
        *(axis.key for axis in grid.axes),
        *(f"{measure.heading}\n{INTERVAL}" for measure in grid.measures),
        *([CHANGE] if _has_spl(grid) else []),
    ]


def point_rows(grid: Grid, name: str) -> Iterator[list[str]]:
    """Yield the cells of an algorithm's row at each point, from the second column on."""
    for point, values in enumerate(grid.points):
        found = [(grid.estimates[measure.name][point, name], measure.decimals) for measure in grid.measures]
        cells = ["" if each is None else each.text(decimals) for each, decimals in found]
        if _has_spl(grid):
            change = grid.change(point, name)
            cells.append("" if change is None else change.text(3, "+"))
        yield [*map(str, values), *cells]


def _table(grid: Grid) -> str:
    head = point_titles(grid)
    rows = []
    for name in grid.algorithms:
        rows.append(("group", [name, *[""] * (len(head) - 1)]))
        rows += [("", ["", *cells]) for cells in point_rows(grid, name)]
    return html.table("Value [95 % interval]", head, html.below(rows))


def _title(grid: Grid) -> str:
    keys = " and ".join(axis.key for axis in grid.axes)
    return f"Sensitivity to {keys}: {', '.join(grid.algorithms)}"
