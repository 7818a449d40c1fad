"""The map of a run, metres east and north.

It shows where the rover went by dead reckoning, laid onto the receiver's fixes, or truly in the forest of a simulation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, isnan, nan, radians, sin
from typing import Any, NamedTuple

import numpy as np
from bokeh.models.annotations import Arrow, NormalHead
from bokeh.plotting import ColumnDataSource

from wayfarer.angles import Coordinates, coordinates_deg
from wayfarer.fieldlog.record import WORLD_CORNER, WORLD_SIZE_M, World
from wayfarer.logview import palette
from wayfarer.logview.receiver_fit import Fit, MapFix, Places, believable, fit, paired, places_of
from wayfarer.reports.data import EDGE, LOOK, PHASES, Columns, Floats, RunData, breaks, columns, event_marks, pieces
from wayfarer.reports.page.plots import Figure, hover, layer, plot, source

Point = tuple[float, float]  # metres east and north


class TimedPath(NamedTuple):
    """A path over time, metres east and north; all but the time is NaN if records are missing."""

    t_s: Floats
    east_m: Floats
    north_m: Floats
    phase: Floats

    def at(self, t_s: float) -> Point:
        """Return the place at a time; NaN if nothing is known."""
        if not self.t_s.size:
            return nan, nan
        return float(np.interp(t_s, self.t_s, self.east_m)), float(np.interp(t_s, self.t_s, self.north_m))

    def beginning_at(self, east_m: float, north_m: float) -> TimedPath:
        """Return the path moved so that it begins there."""
        first_m = self.east_m[:1].sum(), self.north_m[:1].sum()
        return self._replace(east_m=self.east_m - first_m[0] + east_m, north_m=self.north_m - first_m[1] + north_m)

    def mapped(self, onto: Fit) -> TimedPath:
        """Return the path laid onto the receiver's fixes."""
        places_m = onto(self.east_m + 1j * self.north_m)
        return self._replace(east_m=places_m.real, north_m=places_m.imag)


@dataclass(frozen=True)
class Track:
    """What the map shows of one run.

    ``path`` is the best that is known, ``reckoned`` dead reckoning beside it if the run was simulated. ``fixes_m``
    are the places of ``fixes``, and ``origin`` is where the map's zero is; without fixes nobody knows that.
    """

    data: RunData
    path: TimedPath
    reckoned: TimedPath | None = None
    forest: World | None = None
    origin: Coordinates | None = None
    fixes: Sequence[MapFix] = ()
    fit: Fit | None = None

    @property
    def fixes_m(self) -> Places:
        """Return the places of the fixes, metres east + 1j * metres north."""
        return places_of(self.fixes, self.origin) if self.origin else np.array([], dtype=np.complex128)

    @property
    def end_deg(self) -> tuple[float, float] | None:
        """Return latitude and longitude of the end: of the whole path as fitted, else of the last fix."""
        path = self.path if self.reckoned is None else self.reckoned
        if self.origin and self.fit and path.t_s.size:
            return coordinates_deg(self.origin, float(path.north_m[-1]), float(path.east_m[-1]))
        return (self.fixes[-1].latitude_deg, self.fixes[-1].longitude_deg) if self.fixes else None

    @property
    def drift_m(self) -> float:
        """Return how far dead reckoning is from the true path at the end; NaN if one of them is not known."""
        if self.reckoned is None or not (self.reckoned.t_s.size and self.path.t_s.size):
            return nan
        return hypot(self.reckoned.east_m[-1] - self.path.east_m[-1], self.reckoned.north_m[-1] - self.path.north_m[-1])

    def missed_m(self, *, true: bool = False) -> tuple[float, float]:
        """Return the median distance of dead reckoning from the fixes, unfitted (from the first fix) and fitted.

        It is in metres, at the times of the fixes; with ``true`` it is that from the true path of a simulated rover.
        """
        if not self.fit or not self.origin:
            return nan, nan
        compared, reckoned_m = paired(self.fixes)
        fixed_m = places_of(compared, self.origin)
        pinned_m = reckoned_m - reckoned_m[0] + fixed_m[0]
        there_m = np.array([complex(*self.path.at(fix.t_s)) for fix in compared]) if true else fixed_m
        return float(np.median(np.abs(pinned_m - there_m))), float(np.median(np.abs(self.fit(reckoned_m) - there_m)))

    def goals(self) -> Iterator[tuple[Point, float]]:
        """Yield where the rover took a goal, and its heading in degrees on this map."""
        turned_deg = self.fit.turned_deg if self.fit and self.reckoned is None else 0.0
        for t_s, goal_deg in self.data.goals:
            place_m = self.path.at(t_s)
            if not isnan(sum(place_m)):
                yield place_m, goal_deg + turned_deg


def track_of(data: RunData) -> Track:
    """Return what the map shows of a run; with a receiver, zero is at its first fix."""
    path, fixes, forest = _path(data.ticks, "east_m", "north_m"), believable(data.fixes), data.header.world
    if forest is not None and data.truth["x_m"].size:
        laid = fit(fixes, WORLD_CORNER)
        true = _path(data.truth, "x_m", "y_m")
        beside = path.mapped(laid) if laid else path.beginning_at(*true.at(path.t_s[:1].sum()))
        return Track(data, true, beside, forest, WORLD_CORNER if fixes else None, fixes, laid)
    if not fixes:
        return Track(data, path)
    laid = fit(fixes, fixes[0])
    return Track(data, path.mapped(laid) if laid else path, None, None, fixes[0], fixes, laid)


def _path(columns: Columns, east: str, north: str) -> TimedPath:
    """Return the path of a table of ``RunData``, as far as it is known, with a gap where the log has one."""
    known = {name: columns[name][~np.isnan(columns[east])] for name in ("t_s", east, north, "phase", "stretch")}
    t_s, *others = (known[name] for name in ("t_s", east, north, "phase"))
    at = np.flatnonzero(breaks(known)) + 1
    return TimedPath(np.insert(t_s, at, t_s[at]), *(np.insert(each, at, nan) for each in others))


Row = tuple[float, ...]


def draw_forest(map_: Figure, forest: World) -> None:
    """Draw a forest from above, to scale: trunks with round ends, trees, the goal line, and the edges of the world."""
    trunk: Any = {"color": palette.TRUNK, "line_color": None}
    trunks: list[Row] = []
    ends: list[Row] = []
    for (x0_m, y0_m, x1_m, y1_m, _), diameter_m in forest.thick_trunks:
        east_m, north_m = x1_m - x0_m, y1_m - y0_m
        box_m = x0_m + east_m / 2.0, y0_m + north_m / 2.0, hypot(east_m, north_m), diameter_m
        trunks.append((*box_m, atan2(north_m, east_m)))
        ends += [(x0_m, y0_m, diameter_m / 2.0), (x1_m, y1_m, diameter_m / 2.0)]
    box = ("x", "y", "length", "thick", "angle")
    map_.rect(*box, source=_columns(trunks, *box), **trunk)
    map_.circle("x", "y", "radius", source=_columns(ends, "x", "y", "radius"), **trunk)
    trees = _columns(((x_m, y_m, forest.tree_radius_m) for x_m, y_m, *_ in forest.trees_m), "x", "y", "radius")
    map_.circle("x", "y", "radius", source=trees, color=palette.TREE, line_color=None)
    goal_m = forest.goal_y_m
    map_.segment([0.0], [goal_m], [WORLD_SIZE_M], [goal_m], line_color=palette.GOAL_LINE, line_width=3)
    middle_m = [WORLD_SIZE_M / 2.0]
    map_.rect(middle_m, middle_m, WORLD_SIZE_M, WORLD_SIZE_M, fill_color=None, line_color=palette.GREY)


def _columns(rows: Iterable[Row], *names: str) -> ColumnDataSource:
    table = np.array(list(rows), dtype=np.float64).reshape(-1, len(names))
    return source(**dict(zip(names, table.T, strict=True)))


POINTS = 8000  # of a path: an hour at 0.2 m/s has one for each 9 cm
SMALLEST_M = 4.0
GOAL: Mapping[str, Any] = {"line_color": palette.GOAL_LINE, "line_width": 2}  # Bokeh's stubs say "body_line_..."
NUMBER: Mapping[str, Any] = {"text_align": "center", "text_baseline": "middle", "text_font_size": "9px"}
ARROW = 0.12  # of the map's side: length of an arrow to the goal
CROSSES, CIRCLES = 1000, 24  # at most, for the receiver's fixes and for their error: more of them bury the path
ALONE_PX = 640  # at most as wide is a map that is not in a page
ASPECT = 1.15  # of the map: its width is half a screen's, and its height leaves room for what stands above it
END: Mapping[str, Any] = {"marker": "x", "size": 11, "line_width": 3}
START: Mapping[str, Any] = {"marker": "star", "size": 14, "line_width": 1}


def map_plot(track: Track) -> Figure:
    """Return the map, with the path in the colours of its phases."""
    map_ = plot("map", None, "map", sizing_mode="scale_width", aspect_ratio=ASPECT, match_aspect=True)
    map_.min_border_left = 40  # as wide as its numbers, whichever they are
    map_.xaxis.axis_label = "metres east; upwards: metres north"
    if track.forest:
        draw_forest(map_, track.forest)
    side_m = _leave_room(map_, track)
    _draw_fixes(map_, track)
    _draw_event_marks(map_, track, "anomaly", palette.ANOMALY, 8)  # beneath the path: hundreds of them cover it
    _draw_path(map_, track)
    for (east_m, north_m), heading_deg in track.goals():
        along, length_m = radians(heading_deg), ARROW * side_m
        head = NormalHead(size=9, fill_color=palette.GOAL_LINE, line_color=palette.GOAL_LINE)
        tip: dict[str, Any] = {"x_end": east_m + length_m * sin(along), "y_end": north_m + length_m * cos(along)}
        map_.add_layout(Arrow(end=head, x_start=east_m, y_start=north_m, **tip, **GOAL))
    _draw_event_marks(map_, track, "mark", palette.MARK, 16)
    _draw_ends(map_, track.path, from_start=track.data.summary.where.from_start)
    path = _thinned(track.path)  # what the cursor needs: the path over time, unseen, and a ring at the cursor's time
    over_time = source(t=path.t_s, x=path.east_m, y=path.north_m)
    map_.line("x", "y", source=over_time, line_alpha=0.0, name="path")
    ring: Any = {"size": 16, "fill_color": None, "line_width": 3, "color": palette.VERMILION}
    map_.scatter("x", "y", source=source(x=[], y=[]), name="here", **ring)
    return map_


def _leave_room(map_: Figure, track: Track) -> float:
    """Make the map so large that everything is on it, and return its side in metres."""
    paths = [path for path in (track.path, track.reckoned) if path is not None]
    x_m = np.concatenate([*(path.east_m for path in paths), track.fixes_m.real])
    y_m = np.concatenate([*(path.north_m for path in paths), track.fixes_m.imag])
    x_m, y_m = (each[~np.isnan(each)] if not np.isnan(each).all() else np.zeros(1) for each in (x_m, y_m))
    side_m = max(SMALLEST_M, float(np.ptp(x_m)), float(np.ptp(y_m)))
    corners_m = [(each.min() + each.max()) / 2.0 + np.array([-0.55, 0.55]) * side_m for each in (x_m, y_m)]
    map_.scatter(*corners_m, alpha=0.0)
    return side_m


def _draw_fixes(map_: Figure, track: Track) -> None:
    """Draw what the receiver said, with circles of its error: not all of it in a long run."""
    if not track.fixes:
        return
    every = -(-len(track.fixes) // CROSSES)
    fixes, places_m = track.fixes[::every], track.fixes_m[::every]
    crosses = source(
        x=places_m.real, y=places_m.imag, t=[fix.t_s for fix in fixes],
        latitude=[f"{fix.latitude_deg:.6f}" for fix in fixes], longitude=[f"{fix.longitude_deg:.6f}" for fix in fixes],
        error=["unknown" if isnan(fix.error_m) else f"{fix.error_m:.1f} m" for fix in fixes],
    )  # fmt: skip
    every = -(-len(fixes) // CIRCLES)
    circles = source(x=places_m.real[::every], y=places_m.imag[::every], r=[fix.error_m for fix in fixes[::every]])
    thin: Any = {"fill_color": None, "line_color": palette.RECEIVER, "line_alpha": 0.3, "line_width": 0.75}
    rings = map_.circle("x", "y", radius="r", source=circles, **thin)
    dots = map_.scatter("x", "y", source=crosses, marker="cross", size=4, color=palette.RECEIVER, alpha=0.5)
    layer("fixes", rings, dots)
    rows = (("fix", "@latitude @longitude"), ("error", "@error"), ("time", "@t{0.0} s"))
    map_.add_tools(hover([dots], *rows))


def _draw_path(map_: Figure, track: Track) -> None:
    if track.reckoned is not None:
        _line(map_, _thinned(track.reckoned)[1:3], palette.RECKONED, "reckoned", line_dash=[6, 3])
    path = _thinned(track.path)
    for phase, colour in palette.PHASE_COLOURS.items():
        inside = path.phase == PHASES.index(phase)
        if inside.any():
            _line(map_, pieces(inside, path.east_m, path.north_m), colour, phase, line_width=2.5)
    if np.isnan(path.phase).all():
        _line(map_, (path.east_m, path.north_m), palette.GREY, "unknown")


def _draw_event_marks(map_: Figure, track: Track, name: str, colour: str, size: int) -> None:
    """Draw the events of a layer; Bokeh leaves out those whose place is not known. Marks have numbers."""
    marks = [mark for mark in event_marks(track.data) if mark.layer == name]
    x_m, y_m = np.array([track.path.at(mark.t_s) for mark in marks]).reshape(-1, 2).T
    places = source(x=x_m, y=y_m, number=[f"{number}" for number in range(1, len(marks) + 1)], **columns(marks))
    drawn = map_.scatter("x", "y", source=places, size=size, fill_color=colour, **LOOK)
    layer(name, drawn)
    if name == "mark":
        layer(name, map_.text("x", "y", text="number", source=places, **NUMBER))
    map_.add_tools(hover([drawn], ("what", "@what"), ("time", "@t{0.0} s")))


def _draw_ends(map_: Figure, path: TimedPath, *, from_start: bool) -> None:
    """Mark where the path begins again after a gap, its start if the log has it, and its end."""
    behind = np.flatnonzero(np.isnan(path.east_m)) + 1
    map_.scatter(path.east_m[behind], path.north_m[behind], marker="diamond", size=9, fill_color=palette.PAPER, **EDGE)
    if path.t_s.size:
        ends = [(START, 0)] if from_start else []
        for style, at in [*ends, (END, -1)]:
            map_.scatter(path.east_m[[at]], path.north_m[[at]], color=palette.BLUE, **style)


def _thinned(path: TimedPath) -> TimedPath:
    """Return every so many points of a path, with its gaps and its end."""
    every = max(1, -(-path.t_s.size // POINTS))
    kept = np.arange(path.t_s.size) % every == 0
    kept[-1:] = True
    return TimedPath(*(column[kept | np.isnan(path.east_m)] for column in path))


def _line(map_: Figure, places_m: Sequence[Floats], colour: str, name: str, **look: Any) -> None:
    east_m, north_m = places_m
    layer(name, map_.line("x", "y", source=source(x=east_m, y=north_m), line_color=colour, **look))
