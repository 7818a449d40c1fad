"""Figure: a forest seen from above with the path of one trial, coloured by phase."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from math import cos, radians, sin

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from wayfarer.escape.api import Phase
from wayfarer.experiments.report.drawing import VERMILION, WIDTH_IN
from wayfarer.experiments.report.forest_map import (
    END,
    GOAL,
    GOAL_LINE,
    MARGIN_M,
    SLIP,
    START,
    STROKES,
    TREE,
    TRUNK,
    columns,
    draw_forest,
)
from wayfarer.experiments.trajectory import Trace, TrajectoryPoint
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest

SIZE_IN = 3.1
HEADING_M = 5.0  # length of the arrow at the start


def forest_figure(forest: Forest, trace: Trace) -> Figure:
    """Return the drawing of one trial; metres, north up."""
    half_m = WORLD_SIZE_M / 2.0
    figure = _view(forest, trace, (half_m, half_m), half_m + MARGIN_M)
    figure.axes[0].set(xticks=range(0, 51, 10), yticks=range(0, 51, 10))
    return figure


def close_up_figure(forest: Forest, trace: Trace, middle_m: tuple[float, float], extent_m: float) -> Figure:
    """Return the drawing of what lies so far around a place, and a little more."""
    return _view(forest, trace, middle_m, extent_m / 2.0 + MARGIN_M)


def _view(forest: Forest, trace: Trace, middle_m: tuple[float, float], half_m: float) -> Figure:
    """Return the drawing of a square of the map around a place, to ``half_m`` on each side."""
    figure = Figure((SIZE_IN, SIZE_IN))
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.spines[:].set_visible(False)
    x_m, y_m = middle_m
    axes.set_xlim(x_m - half_m, x_m + half_m)
    axes.set_ylim(y_m - half_m, y_m + half_m)
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    draw_forest(axes, forest, 72.0 * SIZE_IN * 0.8 / (2.0 * half_m))  # the axes take four fifths of it
    _draw_start(axes, forest)
    _draw_way(axes, trace)
    return figure


def legend_figure() -> Figure:
    """Return the legend that all drawings of forests share."""
    figure = Figure((WIDTH_IN, 0.72))
    figure.legend(handles=_legend(), loc="center", ncols=4)
    return figure


def _draw_start(axes: Axes, forest: Forest) -> None:
    x_m, y_m = forest.start_m
    along = radians(forest.heading_deg)
    tip = (x_m + HEADING_M * sin(along), y_m + HEADING_M * cos(along))
    axes.annotate(
        "",
        tip,
        (x_m, y_m),
        arrowprops={"arrowstyle": "-|>", "color": VERMILION, "shrinkA": 0, "shrinkB": 0},
        zorder=4,
        annotation_clip=True,
    )
    axes.plot(x_m, y_m, zorder=4.1, **START)


def _draw_way(axes: Axes, trace: Trace) -> None:
    for stroke in STROKES:
        axes.plot(*_pieces(trace.points, stroke.phases), color=stroke.colour, linewidth=stroke.width, zorder=2)
    axes.plot(*columns(trace.slips_m), linestyle="none", zorder=3, **SLIP)
    axes.plot(*columns([point[:2] for point in trace.points[-1:]]), linestyle="none", zorder=3.5, **END)


def _pieces(points: Sequence[TrajectoryPoint], phases: tuple[Phase, ...]) -> tuple[list[float], list[float]]:
    """Return the parts of the way in these phases as one line with gaps; a part ends where the next phase begins."""
    x_m: list[float] = []
    y_m: list[float] = []
    for point, after in pairwise(points):
        if point.phase in phases:
            x_m.append(point.x_m)
            y_m.append(point.y_m)
            if after.phase not in phases:
                x_m += [after.x_m, math.nan]
                y_m += [after.y_m, math.nan]
    return x_m, y_m


def _legend() -> list[Line2D]:
    ways = [Line2D([], [], color=stroke.colour, linewidth=2.2, label=stroke.text) for stroke in STROKES]
    return [
        *ways,
        Line2D([], [], linestyle="none", label="start and goal heading", **START),
        Line2D([], [], linestyle="none", label="end", **END),
        Line2D([], [], linestyle="none", label="slip event", **SLIP),
        Line2D([], [], label="goal line", **GOAL_LINE),
        Line2D([], [], color=TRUNK, linewidth=2.2, label="fallen trunk"),
        Line2D(
            [], [], linestyle="none", marker="o", markersize=5, color=TREE, markeredgecolor=GOAL, label="standing tree"
        ),
    ]
