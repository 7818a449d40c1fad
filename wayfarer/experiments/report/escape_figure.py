"""Figure: cumulative escapes over distance, one panel per group of algorithms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wayfarer.experiments.report.groups import Group, grouped, short
from wayfarer.experiments.report.survival import Curve, escape_curve
from wayfarer.experiments.rows import TrialRow
from wayfarer.views.run_report.drawing import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PALE,
    PURPLE,
    SKY,
    VERMILION,
    WIDTH_IN,
    log_distances,
)

PANEL_IN = 1.55
LEGEND_LINE_IN = 0.19
MARGINS_IN = 0.55
COLUMNS = (1.55, 1.0)  # panel and legend
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)), (0, (3, 1, 1, 1, 1, 1)))


def escape_figure(by_algorithm: Mapping[str, Sequence[TrialRow]]) -> Figure:
    """Return the cumulative share of each algorithm: who has escaped by which path."""
    groups = grouped(by_algorithm)
    curves = {name: escape_curve(rows) for name, rows in by_algorithm.items()}
    ends_m = [end_m for curve in curves.values() for end_m in _ends_m(curve)]
    span_m = (min(ends_m, default=10.0), max(ends_m, default=100.0))
    heights_in = [max(PANEL_IN, LEGEND_LINE_IN * (len(group.algorithms) + 2)) for group in groups]
    figure = Figure((WIDTH_IN, sum(heights_in) + MARGINS_IN))
    grid = figure.subplots(len(groups), 2, squeeze=False, height_ratios=heights_in, width_ratios=COLUMNS)
    for (axes, beside), group in zip(grid, groups, strict=True):
        _panel(axes, group, curves, span_m)
        _legend(beside, axes, group.title)
        axes.label_outer()
    grid[-1, 0].set_xlabel("path driven, m (log scale)")
    figure.supylabel("escaped, %", fontsize="medium")
    return figure


def _ends_m(curve: Curve) -> list[float]:
    """Return the paths at which trials ended; one of no length has no place on a logarithmic axis."""
    return [path_m for path_m in (*(step.path_m for step in curve.steps), *curve.failed_m) if path_m > 0.0]


def _panel(axes: Axes, group: Group, curves: Mapping[str, Curve], span_m: tuple[float, float]) -> None:
    for name, curve in curves.items():
        if name not in group.algorithms:
            axes.plot(*_staircase(curve, span_m[0]), color=PALE, linewidth=0.8)
    for number, name in enumerate(group.algorithms):
        colour, dashes = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
        curve = curves[name]
        label = f"{short(name)}, {100 * curve.escaped:.1f} %"
        axes.plot(*_staircase(curve, span_m[0]), color=colour, linestyle=dashes, label=label)
        last_m = curve.failed_m[-1:]
        axes.plot(last_m, [100 * curve.escaped] * len(last_m), "|", color=colour, markersize=7)
    log_distances(axes, span_m)
    axes.set_ylim(0, 102)
    axes.set_yticks([0, 25, 50, 75, 100])
    axes.grid(visible=True)


def _legend(beside: Axes, axes: Axes, title: str) -> None:
    """Write the legend of a panel beside it, where it covers no curve."""
    beside.axis("off")
    handles, labels = axes.get_legend_handles_labels()
    legend = beside.legend(
        handles, labels, loc="center left", borderaxespad=0.0, title=title, alignment="left", handlelength=2.6
    )
    legend.set_in_layout(False)
    legend.get_title().set_fontweight("bold")


def _staircase(curve: Curve, first_m: float) -> tuple[list[float], list[float]]:
    """Return the corners of a curve, percent over metres, up to the end of the longest trial."""
    x_m, percent = [first_m], [0.0]
    for path_m, escaped in curve.steps:
        x_m += [path_m, path_m]
        percent += [percent[-1], 100 * escaped]
    last_m = max([*x_m, *curve.failed_m])
    return [*x_m, last_m], [*percent, percent[-1]]
