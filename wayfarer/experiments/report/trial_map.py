"""The map of one trial of a campaign: its forest, its true path by phases, slips, start and end."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians

import numpy as np

from wayfarer.escape.api import Phase
from wayfarer.experiments.trajectory import Trajectory, TrajectoryPoint
from wayfarer.fieldlog.vocabulary import in_words
from wayfarer.simhal.world.forest import Forest
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, hover, layer, plot, source
from wayfarer.views.run_report.data import Floats
from wayfarer.views.run_report.events import EDGE
from wayfarer.views.run_report.forest import draw_forest
from wayfarer.views.run_report.series import pieces

PLACE = (("east", "@x{0.0} m"), ("north", "@y{0.0} m"))
AFTER = ("after", "@t_s{0} s")


def trial_map(name: str, forest: Forest, trajectory: Trajectory) -> Figure:
    """Return the map of a trial, metres, north up; ``name`` is the figure's."""
    made = plot(name, None, "map", sizing_mode="scale_width", aspect_ratio=1.0, match_aspect=True)
    made.xaxis.axis_label, made.yaxis.axis_label = "east, m", "north, m"
    draw_forest(made, forest)
    for phase in Phase:
        if phase.value in palette.PHASE_COLOURS:
            x_m, y_m, t_s = path_in(trajectory.points, phase)
            line = made.line(
                "x", "y", source=source(x=x_m, y=y_m, t_s=t_s), line_color=palette.PHASE_COLOURS[phase.value],
                line_width=2, line_join="round",
            )  # fmt: skip
            layer(phase.value, line)
            made.add_tools(hover([line], ("phase", in_words(phase.value)), AFTER, *PLACE, line_policy="nearest"))
    x_m, y_m = np.reshape(trajectory.slips_m, (-1, 2)).T
    slips = made.scatter("x", "y", source=source(x=x_m, y=y_m), size=6, fill_color=palette.ANOMALY, **EDGE)
    layer("slips", slips)
    made.add_tools(hover([slips], ("slip", "the ground gave way"), *PLACE))
    _mark_ends(made, forest, trajectory.points[-1])
    return made


def path_in(points: Sequence[TrajectoryPoint], phase: Phase) -> list[Floats]:
    """Return x, y and time of a path in a phase as one line with gaps; each part ends where the next phase begins."""
    columns = (np.array([getattr(point, name) for point in points]) for name in ("x_m", "y_m", "t_s"))
    return pieces(np.array([point.phase is phase for point in points]), *columns)


def _mark_ends(made: Figure, forest: Forest, last: TrajectoryPoint) -> None:
    """Mark the start with a triangle that points to the goal, and the end with a cross."""
    x_m, y_m = forest.start_m
    start = made.scatter(
        "x", "y", source=source(x=[x_m], y=[y_m]), marker="triangle", size=15, fill_color=palette.GOAL_LINE,
        angle=-radians(forest.heading_deg), **EDGE,
    )  # fmt: skip
    ended = source(x=[last.x_m], y=[last.y_m], t_s=[last.t_s])
    end = made.scatter("x", "y", source=ended, marker="x", size=13, line_width=4, line_color=palette.VERMILION)
    made.add_tools(hover([start], ("start", "points to the goal"), *PLACE), hover([end], ("end", ""), AFTER, *PLACE))
