"""Figure: cumulative escapes over distance, a curve for each algorithm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from bokeh.models.annotations import Legend, LegendItem
from bokeh.plotting import ColumnDataSource

from wayfarer.experiments.outcome import SUCCESSES
from wayfarer.experiments.report.algorithm_rows import SVG, grouped, plain_numbers, short, span_of
from wayfarer.experiments.rows import TrialRow
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, hover, plot, source

CURVES_PX, LEGEND_ROW_PX = 320, 18  # the legend stands below zero, where no curve runs
AXIS_PX = 70
DASHES: tuple[tuple[int, ...], ...] = ((), (7, 2), (2, 2), (8, 2, 2, 2))  # not as many as colours: 20 looks


LEGEND: Mapping[str, Any] = {
    "location": "bottom_right",
    "click_policy": "hide",
    "background_fill_color": None,
    "border_line_color": None,
    "label_text_font_size": "11px",
    "glyph_width": 32,
    "spacing": -4,
    "padding": 0,
    # Bokeh reads --bk-label-text-color before the legend has a place in the page, and finds none.
    "stylesheets": [".bk-label { color: var(--ink) !important; }"],
}


class Curve(NamedTuple):
    """The paths of an algorithm's trials, metres, ascending: of those that escaped, and of those that failed."""

    escaped_m: list[float]
    failed_m: list[float]
    trials: int

    @property
    def escaped_percent(self) -> float:
        """The share of all trials that escaped."""
        return 100.0 * len(self.escaped_m) / self.trials

    def steps(self, first_m: float) -> tuple[list[float], list[float]]:
        """Return where the curve grows and to how many percent, from a path on up to the end of the longest trial."""
        percent = [100.0 * number / self.trials for number in range(len(self.escaped_m) + 1)]
        last_m = max([first_m, *self.escaped_m, *self.failed_m])
        return [first_m, *self.escaped_m, last_m], [*percent, percent[-1]]


def escape_curve(rows: Sequence[TrialRow]) -> Curve:
    """Return the cumulative incidence of escape: which share of all trials has escaped by a path of that length.

    A failure is an end like an escape, not a trial that was lost from sight: it counts as not escaped at any length.
    (Kaplan-Meier would let those under way make up for it, and ends above the share of successes: J. P. Fine, R. J.
    Gray, JASA 94, 1999, on competing risks.) So the curve ends at the success of the results' table.
    """
    escaped_m, failed_m = (
        sorted(row.path_m for row in rows if (row.outcome in SUCCESSES) is out and row.path_m is not None)
        for out in (True, False)
    )
    return Curve(escaped_m, failed_m, len(rows))


def escape_figure(by_algorithm: Mapping[str, Sequence[TrialRow]]) -> Figure:
    """Return the figure: escapes by path length."""
    names = [name for group in grouped(by_algorithm) for name in group.algorithms]
    curves = {name: escape_curve(by_algorithm[name]) for name in names}
    escaped_m = [path_m for curve in curves.values() for path_m in curve.escaped_m]
    span_m = span_of(escaped_m or [path_m for curve in curves.values() for path_m in curve.failed_m])
    legend_px = LEGEND_ROW_PX * (1 + len(curves))
    made = plot(
        "escape", CURVES_PX + legend_px + AXIS_PX, "both", x_axis_type="log", output_backend=SVG, x_range=span_m,
        y_range=(-102.0 * legend_px / CURVES_PX, 102.0),
    )  # fmt: skip
    made.yaxis.bounds = made.ygrid.bounds = (0.0, 100.0)
    plain_numbers(made)
    made.xaxis.axis_label, made.yaxis.axis_label = "path driven, m (logarithmic)", "escaped, % of all trials"
    items = [_curve(made, place, name, curve, span_m[0]) for place, (name, curve) in enumerate(curves.items())]
    made.add_layout(Legend(items=items, **LEGEND))
    return made


def _stairs(curve: Curve, first_m: float) -> ColumnDataSource:
    """Return a curve as corners: a share holds until the next escape."""
    path_m, percent = curve.steps(first_m)
    return source(x=np.repeat(path_m, 2)[1:], y=np.repeat(percent, 2)[:-1])


def colour_of(place: int) -> str:
    """Return the colour of an algorithm, by its place in the campaign."""
    return palette.SERIES[place % len(palette.SERIES)]


def curve_look(place: int) -> dict[str, Any]:
    """Return the look of an algorithm's curve."""
    return {"line_color": colour_of(place), "line_width": 2, "line_dash": list(DASHES[place % len(DASHES)])}


def _curve(made: Figure, place: int, name: str, curve: Curve, first_m: float) -> LegendItem:
    """Draw a curve, with a mark where its longest failure ended, and return its line of the legend."""
    line: Any = made.line("x", "y", source=_stairs(curve, first_m), name=name, **curve_look(place))
    last_m = curve.failed_m[-1:]
    ended: Any = {"marker": "dash", "angle": np.pi / 2, "size": 11, "line_width": 2, "color": colour_of(place)}
    mark: Any = made.scatter(last_m, [curve.escaped_percent] * len(last_m), **ended)
    made.add_tools(hover([line], ("algorithm", "$name"), ("by", "@x{0.0} m"), ("escaped", "@y{0.0} %")))
    return LegendItem(label=f"{short(name)}, {curve.escaped_percent:.1f} %", renderers=[line, mark])
