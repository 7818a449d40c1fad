"""Figure of a sweep over one key: each measure as a curve per algorithm, with 95 % intervals."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wayfarer.experiments.report.drawing import GREY, WIDTH_IN, Style
from wayfarer.experiments.report.escape_figure import COLOURS, DASHES
from wayfarer.experiments.report.groups import short
from wayfarer.experiments.report.reading import SweepResults
from wayfarer.experiments.statistics import Estimate
from wayfarer.experiments.sweep.measures import MEASURES, Measure

PANEL_IN = 1.9
LEGEND_LINE_IN = 0.19
LEGEND_COLUMNS = 3
NOW: Style = {"color": GREY, "linewidth": 0.8, "linestyle": (0, (3, 2)), "zorder": 0.5}
UNKNOWN = Estimate(math.nan, math.nan, math.nan)
NOT_KNOWN = "not known: run with --spl"


def curves_figure(results: SweepResults) -> Figure:
    """Return four panels over the one key that was swept; a broken line marks the value without a sweep."""
    legend_in = LEGEND_LINE_IN * (2 + len(results.algorithms) // LEGEND_COLUMNS)
    figure = Figure((WIDTH_IN, 2 * PANEL_IN + legend_in))
    panels = figure.subplots(2, 2, sharex=True)
    for axes, measure in zip(panels.flat, MEASURES, strict=True):
        _panel(axes, results, measure)
    for axes in panels[-1]:
        axes.set_xlabel(results.axes[0].key)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=LEGEND_COLUMNS)
    return figure


def _panel(axes: Axes, results: SweepResults, measure: Measure) -> None:
    places = _places(axes, results)
    order = sorted(range(len(places)), key=places.__getitem__)
    for number, name in enumerate(results.algorithms):
        estimates = [measure.of(results.cells[point, name]) or UNKNOWN for point in order]
        _curve(axes, [places[point] for point in order], estimates, number, short(name))
    if not _anything_known(results, measure):
        axes.text(0.5, 0.5, NOT_KNOWN, transform=axes.transAxes, horizontalalignment="center", color=GREY)
        axes.set_yticks([])
    if results.now is not None:
        axes.axvline(places[results.now], label="without a sweep", **NOW)
    axes.set_title(measure.title, fontsize="medium", loc="left")
    axes.grid(visible=True)
    axes.set_axisbelow(True)


def _places(axes: Axes, results: SweepResults) -> list[float]:
    """Return where each value is along x: words stand side by side, numbers where they belong."""
    axis = results.axes[0]
    if axis.numeric:
        return [float(value) for value in axis.values]
    axes.set_xticks(range(len(axis.values)), [str(value) for value in axis.values])
    return [float(number) for number in range(len(axis.values))]


def _curve(axes: Axes, x: list[float], estimates: list[Estimate], number: int, label: str) -> None:
    colour, dashes = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
    values, lows, highs = zip(*estimates, strict=True)
    axes.fill_between(x, lows, highs, color=colour, alpha=0.18, linewidth=0)
    axes.plot(x, values, color=colour, linestyle=dashes, marker="o", markersize=2.8, label=label)


def _anything_known(results: SweepResults, measure: Measure) -> bool:
    return any(measure.of(rows) for rows in results.cells.values())
