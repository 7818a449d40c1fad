"""The map of one run: its frame and contents. Metres east and north, north up."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count, islice
from math import cos, hypot, isnan, radians, sin, tau
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from wayfarer.views.run_report.data import Floats
from wayfarer.views.run_report.drawing import BLACK, GREEN, VERMILION, WIDTH_IN
from wayfarer.views.run_report.forest_map import END, START, STROKES
from wayfarer.views.run_report.marks import ANOMALY_MARKS, anomaly_style
from wayfarer.views.run_report.position import LocalFix
from wayfarer.views.run_report.series import pieces

LEFT_IN, RIGHT_IN, TOP_IN, BOTTOM_IN = 0.6, 1.65, 0.1, 0.5  # around the map; the legend is at the right
SIDE_IN = WIDTH_IN - LEFT_IN - RIGHT_IN
SMALLEST_M = 4.0
LINES = 8  # of the grid, at most
BADGE_PT = 10.0
ROUNDING_PT = 1e-6
MANY = 30  # anomalies
CIRCLES = 200  # of error, at most
ARROW = 0.12  # of the map's side: length of an arrow to the goal
LOG_BEGINS: dict[str, Any] = {"marker": "o", "markersize": 6, "color": "white", "markeredgecolor": BLACK}
GAP: dict[str, Any] = {
    "linestyle": "none", "marker": "D", "markersize": 4.5, "color": "white", "markeredgecolor": BLACK,
    "markeredgewidth": 0.8,
}  # fmt: skip
RECEIVER: dict[str, Any] = {"color": GREEN, "linewidth": 0.7, "marker": "+", "markersize": 4.0, "markeredgewidth": 0.7}


Point = tuple[float, float]  # metres east and north


class MapFrame(NamedTuple):
    """What is seen: metres east and north at the lower left, and the length of a side in metres."""

    east_m: float
    north_m: float
    side_m: float

    @property
    def points_per_m(self) -> float:
        """Return the scale, in points of print."""
        return 72.0 * SIDE_IN / self.side_m


class Way(NamedTuple):
    """A way: metres east and north, and which of ``STROKES`` draws it from there on; NaN where it is broken."""

    east_m: Floats
    north_m: Floats
    stroke: Floats


def map_around(places_m: Floats) -> MapFrame:
    """Return a map with all places on it; they are rows of metres east and north."""
    places_m = places_m if places_m.size else np.zeros((1, 2))
    low_m, high_m = np.nanmin(places_m, axis=0), np.nanmax(places_m, axis=0)
    side_m = max(SMALLEST_M, 1.16 * float(max(high_m - low_m)))
    east_m, north_m = (low_m + high_m - side_m) / 2.0
    return MapFrame(float(east_m), float(north_m), side_m)


def frame(shown: MapFrame) -> tuple[Figure, Axes]:
    """Return a figure with the empty map in it, as wide as a page allows."""
    height_in = SIDE_IN + TOP_IN + BOTTOM_IN
    figure = Figure((WIDTH_IN, height_in))
    axes = figure.add_axes((LEFT_IN / WIDTH_IN, BOTTOM_IN / height_in, SIDE_IN / WIDTH_IN, SIDE_IN / height_in))
    axes.set_xlim(shown.east_m, shown.east_m + shown.side_m)
    axes.set_ylim(shown.north_m, shown.north_m + shown.side_m)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(LINES, steps=[1, 2, 5, 10]))
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.grid(visible=True)
    axes.set_axisbelow(True)
    return figure, axes


def broken(way: Way, stretch: Floats) -> Way:
    """Return a way that does not bridge what is missing between one stretch of the log and the next."""
    at = np.flatnonzero(np.diff(stretch)) + 1
    return Way(*(np.insert(column, at, np.nan) for column in way))


def draw_way(axes: Axes, way: Way) -> None:
    """Draw a way in the colours of its phases."""
    for at, stroke in enumerate(STROKES):
        inside = way.stroke == at
        if inside.any():
            line = pieces((way.east_m, way.north_m), inside)
            axes.plot(*line, color=stroke.colour, linewidth=1.2 * stroke.width, label=stroke.text, zorder=2)


def draw_gaps(axes: Axes, way: Way) -> None:
    """Mark where a way goes on behind a break: dead reckoning has the rover near where it lost it."""
    behind = np.flatnonzero(np.isnan(way.east_m)) + 1
    if behind.size:
        axes.plot(way.east_m[behind], way.north_m[behind], label="records missing", zorder=3.5, **GAP)


def draw_ends(axes: Axes, way: Way, *, from_start: bool) -> None:
    """Mark where a way begins and ends; where the beginning is lost, its first place is not the start."""
    first = (START, 0, "start") if from_start else (LOG_BEGINS, 0, "log begins")
    for style, at, label in (first, (END, -1, "end")):
        if way.east_m.size:
            axes.plot(way.east_m[at], way.north_m[at], linestyle="none", label=label, zorder=4, **style)


def draw_arrow(axes: Axes, place_m: Point, heading_deg: float, shown: MapFrame) -> None:
    """Draw a compass heading at a place, for the goal that was taken there."""
    length_m, along = ARROW * shown.side_m, radians(heading_deg)
    tip_m = (place_m[0] + length_m * sin(along), place_m[1] + length_m * cos(along))
    arrow = {"arrowstyle": "-|>", "color": VERMILION, "linewidth": 1.1, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tip_m, place_m, arrowprops=arrow, annotation_clip=False, zorder=3.9)


def draw_onsets(axes: Axes, onsets: Sequence[tuple[str, Point]]) -> None:
    """Mark anomalies, each kind in its own shape; many are drawn smaller."""
    size_pt = 4.2 if len(onsets) <= MANY else 2.6
    for kind in ANOMALY_MARKS:
        places_m = [place_m for each, place_m in onsets if each == kind]
        if places_m:
            axes.plot(*np.array(places_m).T, zorder=3, label=kind.replace("_", " "), **anomaly_style(kind, size_pt))


def draw_marks(axes: Axes, marks: Sequence[tuple[int, Point]], shown: MapFrame) -> None:
    """Draw a person's marks: a line from each place to a badge with the mark's number."""
    known = [(number, east_m, north_m) for number, (east_m, north_m) in marks if not isnan(east_m + north_m)]
    scale = shown.points_per_m
    badges_pt = spread_badges([(east_m * scale, north_m * scale) for _, east_m, north_m in known], BADGE_PT)
    badge = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": BLACK, "linewidth": 0.7}
    for (number, east_m, north_m), (x_pt, y_pt) in zip(known, badges_pt, strict=True):
        axes.plot([east_m, x_pt / scale], [north_m, y_pt / scale], color=BLACK, linewidth=0.7, zorder=4.5)
        axes.text(
            x_pt / scale,
            y_pt / scale,
            f"{number}",
            fontsize=6.5,
            ha="center",
            va="center_baseline",
            bbox=badge,
            zorder=5,
        )


def spread_badges(places_pt: Sequence[tuple[float, float]], size_pt: float) -> list[tuple[float, float]]:
    """Return where badges go, each as near to its place as can be without lying on the place or on another badge."""
    taken: list[tuple[float, float]] = []
    for x_pt, y_pt in places_pt:
        around = (
            (x_pt + ring * size_pt * cos(turn), y_pt + ring * size_pt * sin(turn))
            for ring in count(1)
            for turn in (tau * (step + 0.5) / (6 * ring) for step in range(6 * ring))
        )
        taken.append(
            next(at for at in around if all(hypot(at[0] - x, at[1] - y) >= size_pt - ROUNDING_PT for x, y in taken))
        )
    return taken


def draw_fixes(axes: Axes, fixes: Sequence[LocalFix]) -> None:
    """Draw what the receiver said, with circles of its error."""
    if not fixes:
        return
    axes.plot(
        [fix.east_m for fix in fixes], [fix.north_m for fix in fixes], label="receiver's fixes", zorder=1.8, **RECEIVER
    )
    circles = [
        Circle((fix.east_m, fix.north_m), fix.error_m)
        for fix in islice(fixes, 0, None, -(-len(fixes) // CIRCLES))
        if not isnan(fix.error_m)
    ]
    axes.add_collection(
        PatchCollection(circles, facecolor="none", edgecolor=GREEN, alpha=0.25, linewidth=0.5, zorder=1.2)
    )


def draw_legend(axes: Axes, *keys: dict[str, Any]) -> None:
    """Say at the right of the map what is what; ``keys`` are the styles of what was drawn without a label."""
    drawn, _ = axes.get_legend_handles_labels()
    handles = [*drawn, *(Line2D([], [], **key) for key in keys)]
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7.5, handlelength=1.6)
