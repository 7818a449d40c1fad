"""Figure: path length over the shortest path; a failed trial counts as infinite."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from wayfarer.experiments.report.drawing import BLACK, BLUE, EDGE, GREY, SKY, WIDTH_IN, log_axis
from wayfarer.experiments.report.groups import grouped
from wayfarer.experiments.report.rows_layout import label_rows, lay_out
from wayfarer.experiments.rows import SUCCESSES, TrialRow

MARGINS_IN = 1.15
TIMES = "\N{MULTIPLICATION SIGN}"
MULTIPLES = (1.0, 2.0, 4.0)
COLUMNS_PT = (40.0, 78.0)  # right edges of the columns beside the axes
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def ratios(rows: Sequence[TrialRow]) -> list[float]:
    """Return path over shortest path of each trial where that is known, ascending; infinite for failures."""
    return sorted(
        row.path_m / row.shortest_path_m if row.outcome in SUCCESSES and row.path_m else math.inf
        for row in rows
        if row.shortest_path_m
    )


def quantile(values: Sequence[float], share: float) -> float:
    """Return the smallest value that at least this share, above 0 and up to 1, of the values does not exceed.

    It is one of them, never between two: between a path and a failure, which is infinite, there is nothing.
    """
    return float(np.quantile(values, share, method="inverted_cdf"))


def ratio_figure(by_algorithm: Mapping[str, Sequence[TrialRow]]) -> Figure:
    """Return quantiles of path over shortest path by algorithm; shortest paths are known for some trial at least."""
    layout = lay_out(grouped(by_algorithm))
    figure = Figure((WIDTH_IN, layout.height_in + MARGINS_IN))
    axes = figure.subplots()
    known = {name: found for name, rows in by_algorithm.items() if (found := ratios(rows))}
    drawn = [quantile(found, share) for found in known.values() for share in QUANTILES]
    ticks = _doublings(max((ratio for ratio in drawn if ratio < math.inf), default=1.0))
    log_axis(axes, ticks, TIMES)
    # Over the edge of the map a path may be shorter than the shortest.
    axes.set_xlim(min(1.0, *drawn) / EDGE, ticks[-1])
    for name, found in known.items():
        _row(axes, layout.at[name], found)
    for multiple in MULTIPLES:
        axes.axvline(multiple, color=GREY, linewidth=0.8, zorder=0.5)
    label_rows(axes, layout)
    _at_the_right(axes, layout.headings[0][0], [f"≤ {multiple:g}{TIMES}" for multiple in MULTIPLES[1:]])
    axes.set_xlabel("path over shortest path (log scale)")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=3)
    return figure


def _doublings(high: float) -> list[float]:
    """Return 1, 2, 4, ... up to the first at or above ``high``, and to 8 at least."""
    return [2.0**power for power in range(max(4, math.ceil(math.log2(high)) + 1))]


def _row(axes: Axes, y: float, found: Sequence[float]) -> None:
    """Draw one algorithm; a quantile that lies among the failures is beyond the edge, with an arrow towards it."""
    edge = axes.get_xlim()[1]
    low, first, median, third, high = (min(edge, quantile(found, share)) for share in QUANTILES)
    axes.plot([low, high], [y, y], color=SKY, linewidth=1.6, solid_capstyle="butt")
    axes.plot([first, third], [y, y], color=BLUE, linewidth=5.0, solid_capstyle="butt")
    if median < edge:
        axes.plot(median, y, "o", color="white", markeredgecolor=BLACK, markersize=5.5)
    if quantile(found, QUANTILES[-1]) == math.inf:
        colour = BLUE if quantile(found, QUANTILES[-2]) == math.inf else SKY
        axes.plot(edge, y, ">", color=colour, markersize=6, clip_on=False, zorder=3)
    _at_the_right(axes, y, [f"{100 * sum(ratio <= m for ratio in found) / len(found):.0f} %" for m in MULTIPLES[1:]])


def _at_the_right(axes: Axes, y: float, texts: Sequence[str]) -> None:
    """Write a line of the columns beside the rows."""
    for text, right_pt in zip(texts, COLUMNS_PT, strict=True):
        axes.annotate(
            text,
            (1.0, y),
            xycoords=("axes fraction", "data"),
            xytext=(right_pt, 0),
            textcoords="offset points",
            horizontalalignment="right",
            verticalalignment="center_baseline",
        )


def _legend() -> list[Line2D]:
    return [
        Line2D(
            [], [], color="white", markeredgecolor=BLACK, marker="o", markersize=5.5, linestyle="none", label="median"
        ),
        Line2D([], [], color=BLUE, linewidth=5.0, label="middle half"),
        Line2D([], [], color=SKY, linewidth=1.6, label="5th to 95th percentile"),
    ]
