"""The track of a run seen from above: by dead reckoning, and in the forest if it was simulated."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot, isnan, nan
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from wayfarer.fieldlog.fields import number
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.drawing import GREY, VERMILION
from wayfarer.views.run_report.forest_map import GOAL, MARGIN_M, TREE, TRUNK, draw_forest
from wayfarer.views.run_report.map import (
    MapFrame,
    Point,
    Way,
    broken,
    draw_arrow,
    draw_ends,
    draw_fixes,
    draw_gaps,
    draw_legend,
    draw_marks,
    draw_onsets,
    draw_way,
    frame,
    map_around,
)  # fmt: skip
from wayfarer.views.run_report.marks import stroke_of
from wayfarer.views.run_report.position import local_metres

RECKONED: dict[str, Any] = {"color": GREY, "linewidth": 0.9, "linestyle": (0, (4, 1.5)), "label": "dead reckoning"}
ARROW: dict[str, Any] = {"color": VERMILION, "linewidth": 1.1, "marker": ">", "markersize": 4, "label": "goal heading"}
TRUNK_KEY: dict[str, Any] = {"color": TRUNK, "linewidth": 2.2, "label": "fallen trunk"}
TREE_KEY: dict[str, Any] = {
    "color": TREE, "linestyle": "none", "marker": "o", "markersize": 5, "markeredgecolor": GOAL,
    "label": "standing tree",
}  # fmt: skip


def track_figure(data: RunData) -> Figure:
    """Return the way by dead reckoning, with the receiver's fixes where there are some."""
    way, fixes = _reckoned(data), local_metres(data.fixes)
    fixes_m = np.reshape([(fix.east_m, fix.north_m) for fix in fixes], (-1, 2))
    shown = map_around(np.concatenate([np.stack([way.east_m, way.north_m], axis=1), fixes_m]))
    figure, axes = frame(shown)
    draw_fixes(axes, fixes)
    draw_way(axes, way)
    goals = list(_goals(data, way))
    for place_m, goal_deg in goals:
        draw_arrow(axes, place_m, goal_deg, shown)
    draw_onsets(axes, [(onset.kind, (onset.east_m, onset.north_m)) for onset in data.onsets])
    draw_gaps(axes, way)
    draw_ends(axes, way, from_start=data.summary.where.from_start)
    draw_marks(axes, [(event.mark, (event.east_m, event.north_m)) for event in data.events if event.mark], shown)
    draw_legend(axes, *([ARROW] if goals else []))
    return figure


def forest_track_figure(data: RunData, forest: Forest) -> Figure:
    """Return where a simulated rover really went, and where dead reckoning had it."""
    shown = MapFrame(-MARGIN_M, -MARGIN_M, WORLD_SIZE_M + 2 * MARGIN_M)
    figure, axes = frame(shown)
    true, reckoned = _true(data), _from_true_start(data)
    draw_way(axes, true)
    axes.plot(reckoned.east_m, reckoned.north_m, zorder=2.5, **RECKONED)
    draw_onsets(axes, [(onset.kind, _true_place(data, onset.t_s)) for onset in data.onsets])
    draw_ends(axes, true, from_start=data.summary.where.from_start)
    draw_marks(axes, [(event.mark, _true_place(data, event.t_s)) for event in data.events if event.mark], shown)
    draw_forest(axes, forest, shown.points_per_m)
    draw_legend(axes, TRUNK_KEY, TREE_KEY)
    return figure


def drift_m(data: RunData) -> float:
    """Return how far dead reckoning is from the truth at the end; NaN where one of them is not known."""
    true, reckoned = _true(data), _from_true_start(data)
    if not true.east_m.size or not reckoned.east_m.size:
        return nan
    return hypot(reckoned.east_m[-1] - true.east_m[-1], reckoned.north_m[-1] - true.north_m[-1])


def _reckoned(data: RunData) -> Way:
    ticks = data.ticks
    known = ~np.isnan(ticks["north_m"] + ticks["east_m"])
    way = Way(ticks["east_m"][known], ticks["north_m"][known], stroke_of(ticks["phase"])[known])
    return broken(way, ticks["stretch"][known])


def _true(data: RunData) -> Way:
    truth = data.truth
    return broken(Way(truth["x_m"], truth["y_m"], stroke_of(truth["phase"])), truth["stretch"])


def _from_true_start(data: RunData) -> Way:
    """Return the way by dead reckoning in the metres of the forest: it begins where the rover really was."""
    way, true = _reckoned(data), _true(data)
    if not way.east_m.size or not true.east_m.size:
        return way
    return way._replace(
        east_m=way.east_m + (true.east_m[0] - way.east_m[0]), north_m=way.north_m + (true.north_m[0] - way.north_m[0])
    )


def _true_place(data: RunData, t_s: float) -> Point:
    truth = data.truth
    return float(np.interp(t_s, truth["t_s"], truth["x_m"])), float(np.interp(t_s, truth["t_s"], truth["y_m"]))


def _goals(data: RunData, way: Way) -> Iterator[tuple[Point, float]]:
    """Yield where the rover took a goal, and its heading in degrees; a log may begin after that."""
    told = [event for event in data.events if event.name in ("armed", "goal")]
    for event in told:
        goal_deg = number(event.record, "goal_heading_deg")
        if goal_deg is not None and not isnan(event.east_m + event.north_m):
            yield (event.east_m, event.north_m), goal_deg
    goals_deg = data.ticks["goal_heading_deg"]
    goals_deg = goals_deg[~np.isnan(goals_deg)]
    if not told and goals_deg.size and way.east_m.size:
        yield (float(way.east_m[0]), float(way.north_m[0])), float(goals_deg[0])
