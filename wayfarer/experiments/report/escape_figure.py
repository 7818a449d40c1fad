"""Figure: cumulative escapes over distance, one panel per group of algorithms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wayfarer.experiments.report.drawing import (
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
from wayfarer.experiments.report.groups import Group, grouped, short
from wayfarer.experiments.rows import SUCCESSES, TrialRow

PANEL_IN = 1.55
LEGEND_LINE_IN = 0.19
MARGINS_IN = 0.55
STEPS = "steps-post"  # a share holds until the next escape
COLUMNS = (1.55, 1.0)  # panel and legend
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK)
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)), (0, (3, 1, 1, 1, 1, 1)))


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
    """Return the cumulative share of each algorithm: who has escaped by which path."""
    groups = grouped(by_algorithm)
    curves = {name: escape_curve(rows) for name, rows in by_algorithm.items()}
    every_m = (path_m for curve in curves.values() for path_m in (*curve.escaped_m, *curve.failed_m))
    ends_m = [path_m for path_m in every_m if path_m > 0.0]  # no length has no place on a logarithmic axis
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


def _panel(axes: Axes, group: Group, curves: Mapping[str, Curve], span_m: tuple[float, float]) -> None:
    for name, curve in curves.items():
        if name not in group.algorithms:
            axes.plot(*curve.steps(span_m[0]), color=PALE, linewidth=0.8, drawstyle=STEPS)
    for number, name in enumerate(group.algorithms):
        colour, dashes = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
        curve = curves[name]
        label = f"{short(name)}, {curve.escaped_percent:.1f} %"
        axes.plot(*curve.steps(span_m[0]), color=colour, linestyle=dashes, label=label, drawstyle=STEPS)
        last_m = curve.failed_m[-1:]
        axes.plot(last_m, [curve.escaped_percent] * len(last_m), "|", color=colour, markersize=7)
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
