"""Figures of a search: its history, the importance of the keys, and the front of path against anomalies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from wayfarer.experiments.report.algorithm_rows import SVG
from wayfarer.experiments.tuning.objective import ANOMALIES, PATH, QUANTITIES
from wayfarer.experiments.tuning.summary import TriedPoint, TuneSummary
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, hover, plot, source

HEIGHT_PX, ROW_PX, AXES_PX = 280, 26, 60
EDGE = 1.05  # of an axis, over the longest bar
FRONT_COLOURS = {"points": palette.BLUE, "present": palette.VERMILION, "best": palette.GREEN}
CANDIDATES = {"whole", "worse"}  # not: what broke the limit, and what could not be run


def history_figure(summary: TuneSummary) -> Figure:
    """Return the gain of each point, in the order of the search, and the best so far."""
    made = plot("history", HEIGHT_PX, "both", output_backend=SVG)
    quantity = QUANTITIES[summary.objective]
    made.xaxis.axis_label, made.yaxis.axis_label = "point", f"gain, {quantity.title}"
    shown = [point for point in summary.points if point.ended in CANDIDATES and point.gain is not None]
    for whole in (False, True):
        of = [point for point in shown if (point.ended == "whole") is whole]
        fill = palette.BLUE if whole else None
        told = _told(summary, of, x=[point.point for point in of], y=[point.gain for point in of])
        drawn = made.scatter("x", "y", source=told, size=7, line_color=palette.BLUE, fill_color=fill)
        made.add_tools(hover([drawn], *_rows(summary)))
    best = list(accumulate((max(0.0, _whole_gain(point)) for point in summary.points), max))
    numbers = [point.point for point in summary.points]
    made.step(numbers, best, mode="after", line_color=palette.VERMILION, line_width=2)
    return made


def _whole_gain(point: TriedPoint) -> float:
    return point.gain if point.ended == "whole" and point.gain is not None else 0.0


def importance_figure(summary: TuneSummary) -> Figure:
    """Return a bar for each key, the most important one on top."""
    keys = list(summary.importance)[::-1]
    x_range = (0.0, EDGE * max(summary.importance.values()))
    height_px = AXES_PX + ROW_PX * len(keys)
    made = plot("importance", height_px, "width", output_backend=SVG, y_range=keys, x_range=x_range)
    made.xaxis.axis_label = "importance"
    bars = source(key=keys, share=[summary.importance[key] for key in keys])
    drawn = made.hbar("key", right="share", height=0.6, source=bars, color=palette.BLUE)
    made.add_tools(hover([drawn], ("key", "@key"), ("importance", "@share{0.00}")))
    return made


def front_figure(summary: TuneSummary) -> Figure:
    """Return path against anomalies of every point with all its trials, and the front of those."""
    made = plot("front", HEIGHT_PX + AXES_PX, "both", output_backend=SVG)
    made.xaxis.axis_label, made.yaxis.axis_label = f"{ANOMALIES.title} a trial", PATH.title
    whole = [point for point in summary.points if point.ended == "whole" and _place(point)]
    made.step(*_columns(pareto_front(whole)), mode="after", line_color=palette.GREY, line_dash=[4, 3])
    for name, number in {"points": None, "present": 0, "best": summary.best}.items():
        of = whole if name == "points" else [point for point in whole if point.point == number]
        x, y = _columns(of)
        size, colour = 7 if name == "points" else 11, FRONT_COLOURS[name]
        drawn = made.scatter("x", "y", source=_told(summary, of, x=x, y=y), size=size, color=colour)
        made.add_tools(hover([drawn], *_rows(summary)))
    return made


def pareto_front(points: Sequence[TriedPoint]) -> list[TriedPoint]:
    """Return the points that no other one beats in both path and anomalies, by anomalies."""
    front: list[TriedPoint] = []
    for point in sorted(points, key=_place):
        if not front or _place(point)[1] < _place(front[-1])[1]:
            front.append(point)
    return front


def _place(point: TriedPoint) -> tuple[float, ...]:
    """Return mean anomalies and path; nothing where one is not known."""
    anomalies, path_m = point.means[ANOMALIES.name], point.means[PATH.name]
    return () if anomalies is None or path_m is None else (anomalies, path_m)


def _columns(points: Sequence[TriedPoint]) -> tuple[list[float], list[float]]:
    places = [_place(point) for point in points]
    return [place[0] for place in places], [place[1] for place in places]


def _told(summary: TuneSummary, points: Sequence[TriedPoint], **places: Sequence[float | None]) -> object:
    """Return columns for the points: where they are, and what is told of each."""
    values = {key: [f"{point.values[key]:g}" for point in points] for key in summary.space}
    return source(
        **places, point=[str(point.point) for point in points], trials=[str(p.trials) for p in points], **values
    )


def _rows(summary: TuneSummary) -> list[tuple[str, str]]:
    keys = [(key, f"@{{{key}}}") for key in summary.space]
    return [("point", "@point"), *keys, ("trials", "@trials")]
