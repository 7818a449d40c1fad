"""Figure of the paper's simulations: path lengths and failures, by algorithm and group."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.cbook import boxplot_stats
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from wayfarer.experiments.report.drawing import BLACK, GREY, ORANGE, VERMILION, WIDTH_IN, Style, log_distances
from wayfarer.experiments.report.groups import grouped
from wayfarer.experiments.report.rows_layout import Rows, label_rows, lay_out
from wayfarer.experiments.rows import SUCCESSES, TrialRow
from wayfarer.experiments.statistics import AlgorithmSummary
from wayfarer.experiments.tables import PAPER

BOX = "#A9CBE3"
MARGINS_IN = 1.15  # axis labels and legend
MEAN: Style = {
    "marker": "D",
    "markersize": 4.0,
    "markerfacecolor": BLACK,
    "markeredgecolor": "white",
    "linestyle": "none",
}
PAPERS_MEAN: Style = {"marker": "x", "markersize": 5.5, "markeredgewidth": 1.5, "color": VERMILION, "linestyle": "none"}
SHORTEST: Style = {"color": "#C1121F", "linestyle": (0, (5, 2)), "linewidth": 1.3}
OUTLIER: Style = {
    "marker": "o",
    "markersize": 2.6,
    "markerfacecolor": "none",
    "markeredgecolor": GREY,
    "markeredgewidth": 0.5,
}
WHISKERS_IQR = 1.5  # Tukey's


def paths_figure(
    by_algorithm: Mapping[str, Sequence[TrialRow]],
    summaries: Mapping[str, AlgorithmSummary],
    shortest_paths_m: Sequence[float],
) -> Figure:
    """Return box plots of the successes' paths beside bars of the share that did not get out."""
    layout = lay_out(grouped(by_algorithm))
    figure = Figure((WIDTH_IN, layout.height_in + MARGINS_IN))
    paths, failures = figure.subplots(1, 2, width_ratios=(3, 1), sharey=True, gridspec_kw={"wspace": 0.08})
    shortest_m = statistics.fmean(shortest_paths_m) if shortest_paths_m else None
    _boxes(paths, layout, {name: _paths_m(rows) for name, rows in by_algorithm.items()}, shortest_m)
    _bars(failures, layout, summaries)
    label_rows(paths, layout)
    figure.legend(handles=_legend(layout, shortest_m), loc="outside lower center", ncols=3)
    return figure


def _paths_m(rows: Sequence[TrialRow]) -> list[float]:
    return [row.path_m for row in rows if row.outcome in SUCCESSES and row.path_m]


def _boxes(axes: Axes, layout: Rows, paths_m: Mapping[str, list[float]], shortest_m: float | None) -> None:
    shown = [name for name in layout.at if paths_m[name]]
    stats = [boxplot_stats(paths_m[name], whis=WHISKERS_IQR)[0] for name in shown]
    axes.bxp(
        stats,
        positions=[layout.at[name] for name in shown],
        widths=0.62,
        orientation="horizontal",
        manage_ticks=False,
        showmeans=True,
        meanprops=MEAN,
        flierprops=OUTLIER,
        patch_artist=True,
        boxprops={"facecolor": BOX, "linewidth": 0.7},
        medianprops={"color": BLACK, "linewidth": 1.6, "solid_capstyle": "butt"},
        whiskerprops={"linewidth": 0.7},
        capprops={"linewidth": 0.7},
    )
    papers_m = {name: PAPER[name].path_mean_m for name in layout.at if name in PAPER}
    axes.plot([*papers_m.values()], [layout.at[name] for name in papers_m], zorder=5, **PAPERS_MEAN)
    seen_m = [*papers_m.values(), *(path_m for name in shown for path_m in paths_m[name])]
    if shortest_m is not None:
        axes.axvline(shortest_m, **SHORTEST)
        seen_m.append(shortest_m)
    log_distances(axes, seen_m)
    axes.set_xlabel("path length to the destination line, m (log scale)")


def _bars(axes: Axes, layout: Rows, summaries: Mapping[str, AlgorithmSummary]) -> None:
    """Draw failures in percent with their Wilson interval, and write the number at the right."""
    shares = {name: _failures_percent(summary) for name, summary in summaries.items()}
    y = [layout.at[name] for name in shares]
    failed, low, high = zip(*shares.values(), strict=True)
    axes.barh(y, failed, height=0.62, color=ORANGE)
    axes.hlines(y, low, high, color=BLACK, linewidth=0.9)
    axes.plot([*low, *high], [*y, *y], "|", color=BLACK, markersize=4, clip_on=False)
    axes.set_xlim(0.0, next(limit for limit in (5, 10, 20, 40, 60, 100) if limit >= max(high)))
    axes.set_xlabel("did not get out, %")
    axes.grid(visible=True, axis="x")
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0)
    for at, share in zip(y, failed, strict=True):
        axes.annotate(
            f"{share:.1f}",
            (1.0, at),
            xycoords=("axes fraction", "data"),
            xytext=(3, 0),
            textcoords="offset points",
            va="center_baseline",
        )


def _failures_percent(summary: AlgorithmSummary) -> tuple[float, float, float]:
    """Return the share of failures and the ends of its interval, within 0..100."""
    ends = (summary.success_percent, summary.success_high_percent, summary.success_low_percent)
    failed, low, high = (min(100.0, max(0.0, 100.0 - end)) for end in ends)
    return failed, low, high


def _legend(layout: Rows, shortest_m: float | None) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Patch(facecolor=BOX, edgecolor=BLACK, linewidth=0.7, label="quartiles and median"),
        Line2D([], [], label="mean", **MEAN),
        Line2D([], [], linestyle="none", label="outlier", **OUTLIER),
        Patch(facecolor=ORANGE, label="failures, 95 % interval"),
    ]
    if not PAPER.keys().isdisjoint(layout.at):
        handles.append(Line2D([], [], label="the paper's mean", **PAPERS_MEAN))
    if shortest_m is not None:
        handles.append(Line2D([], [], label=f"mean shortest path, {shortest_m:.1f} m", **SHORTEST))
    return handles
