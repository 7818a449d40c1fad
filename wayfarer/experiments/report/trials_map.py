"""The map of the worst trials, which shows one of them at a time: its forest, its path by phases, and its end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import CDSView, GroupFilter

from wayfarer.escape.api import Phase
from wayfarer.experiments.entrapment_cause import Entrapment
from wayfarer.experiments.rows import TrialRow
from wayfarer.experiments.trajectory import Trajectory, TrajectoryPoint
from wayfarer.fieldlog.vocabulary import PHASE_TEXTS
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, hover, layer, plot, source
from wayfarer.views.run_report.data import Floats
from wayfarer.views.run_report.events import EDGE
from wayfarer.views.run_report.forest import draw_forests
from wayfarer.views.run_report.series import pieces

MARGIN_M = 1.5  # around the map: a rover may leave it
TOLD_EVERY = 5  # points of a path, which are 0.2 m apart: the hover box tells of the nearest one
SHOWN = "shown"  # the name of the filter; its group is the number of the trial


class DrawnTrial(NamedTuple):
    """A trial with all that its drawing shows; ``entrapped`` says why, where it was."""

    row: TrialRow
    forest: Forest
    trajectory: Trajectory
    entrapped: Entrapment | None


def trials_map(trials: Sequence[DrawnTrial]) -> Figure:
    """Return the map; metres, north up. ``trials.js`` chooses the trial, which is the first to begin with."""
    made = plot("trials", None, "map", sizing_mode="scale_width", aspect_ratio=1.0, match_aspect=True)
    made.xaxis.axis_label, made.yaxis.axis_label = "east, m", "north, m"
    _leave_room(made)
    draw_forests(made, [trial.forest for trial in trials])
    for phase in Phase:
        if phase.value in palette.PHASE_COLOURS:
            _paths(made, trials, phase)
    _marks(made, trials)
    shown = GroupFilter(column_name="number", group=0, name=SHOWN)
    renderers: Any = made.renderers
    for renderer in renderers:
        if "number" in renderer.data_source.data:
            renderer.view = CDSView(filter=shown)  # one each: a view knows the rows of one source
    return made


def _leave_room(made: Figure) -> None:
    """Show the world and some room around it for all trials alike: a rover may leave it."""
    ends_m = [-MARGIN_M, WORLD_SIZE_M + MARGIN_M]
    corners = made.scatter(ends_m, ends_m, alpha=0.0)
    made.x_range.renderers = made.y_range.renderers = [corners]  # type: ignore[attr-defined]  # both are DataRange1d


def _paths(made: Figure, trials: Sequence[DrawnTrial], phase: Phase) -> None:
    """Draw the parts of all paths in a phase, and put points on them that tell what the rover did there."""
    lines = [path_in(trial.trajectory.points, phase) for trial in trials]
    paths = source(number=range(len(trials)))
    for name, at in (("xs", 0), ("ys", 1)):
        paths.data[name] = [source(path=line[at]).data["path"] for line in lines]
    colour = palette.PHASE_COLOURS[phase.value]
    line = made.multi_line("xs", "ys", source=paths, line_color=colour, line_width=2, line_join="round")
    told = _columns(trials, lambda trial: _reached(trial.trajectory.points, phase), ("x", "y", "t_s"))
    points = made.scatter("x", "y", source=told, size=7, alpha=0.0, hover_alpha=0.8, color=colour)
    layer(phase.value, line, points)
    made.add_tools(hover([points], ("phase", PHASE_TEXTS[phase.value]), ("after", "@t_s{0} s"), *PLACE))


PLACE = (("east", "@x{0.0} m"), ("north", "@y{0.0} m"))


def path_in(points: Sequence[TrajectoryPoint], phase: Phase) -> list[Floats]:
    """Return the parts of a path in a phase as one line with gaps; a part ends where the next phase begins."""
    columns = ([getattr(point, name) for point in points] for name in ("x_m", "y_m"))
    return pieces(np.array([point.phase is phase for point in points]), *map(np.array, columns))


def _reached(points: Sequence[TrajectoryPoint], phase: Phase) -> list[tuple[float, ...]]:
    return [(point.x_m, point.y_m, point.t_s) for point in points[::TOLD_EVERY] if point.phase is phase]


def _marks(made: Figure, trials: Sequence[DrawnTrial]) -> None:
    """Mark slips, the start with the goal heading, the end, and the ground that an entrapped rover kept to."""
    slips = made.scatter(
        "x", "y", source=_columns(trials, lambda trial: trial.trajectory.slips_m, ("x", "y")), size=6,
        fill_color=palette.ANOMALY, **EDGE,
    )  # fmt: skip
    layer("slips", slips)
    starts = _columns(trials, lambda t: [(*t.forest.start_m, -radians(t.forest.heading_deg))], ("x", "y", "angle"))
    start = made.scatter(
        "x", "y", angle="angle", source=starts, marker="triangle", size=15, fill_color=palette.GOAL_LINE, **EDGE
    )
    ends = _columns(trials, lambda t: [(p.x_m, p.y_m, p.t_s) for p in t.trajectory.points[-1:]], ("x", "y", "t_s"))
    end = made.scatter(
        "x", "y", source=ends, marker="x", name="end", size=13, line_width=4, line_color=palette.VERMILION
    )
    kept = _columns(trials, _kept, ("x", "y", "size"))
    made.rect(
        "x", "y", "size", "size", source=kept, fill_color=None, line_color=palette.VERMILION,
        line_dash=[4, 3], name="kept",
    )  # fmt: skip
    made.add_tools(
        hover([slips], ("slip", "the ground gave way"), *PLACE),
        hover([start], ("start", "points to the goal"), *PLACE),
        hover([end], ("end", "after @t_s{0} s"), *PLACE),
    )


def _kept(trial: DrawnTrial) -> list[tuple[float, ...]]:
    found = trial.entrapped
    return [] if found is None else [(*found.middle_m, found.extent_m + MARGIN_M)]


def _columns(trials: Sequence[DrawnTrial], rows_of: Callable[[DrawnTrial], Any], names: Sequence[str]) -> Any:
    """Return what ``rows_of`` each trial as columns, with its number in ``number``."""
    rows = [(number, *row) for number, trial in enumerate(trials) for row in rows_of(trial)]
    columns = zip(*rows, strict=True) if rows else [()] * (len(names) + 1)
    return source(**dict(zip(("number", *names), columns, strict=True)))
