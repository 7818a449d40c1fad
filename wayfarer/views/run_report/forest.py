"""A forest seen from above, to scale."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import atan2, hypot
from typing import Any

import numpy as np
from bokeh.plotting import ColumnDataSource

from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, source

Row = tuple[float, ...]


def draw_forest(map_: Figure, forest: Forest) -> None:
    """Draw trunks with their round ends, trees, the goal line, and the edges of the world."""
    trunk: Any = {"color": palette.TRUNK, "line_color": None}
    trunks = _columns(_trunks(forest), "x", "y", "length", "thick", "angle")
    map_.rect("x", "y", "length", "thick", "angle", source=trunks, **trunk)
    map_.circle("x", "y", "radius", source=_columns(_trunk_ends(forest), "x", "y", "radius"), **trunk)
    trees = _columns(((*tree_m, forest.tree_radius_m) for tree_m in forest.trees_m), "x", "y", "radius")
    map_.circle("x", "y", "radius", source=trees, color=palette.TREE, line_color=None)
    goal_m = forest.goal_y_m
    map_.segment([0.0], [goal_m], [WORLD_SIZE_M], [goal_m], line_color=palette.GOAL_LINE, line_width=3)
    middle_m = [WORLD_SIZE_M / 2.0]
    map_.rect(middle_m, middle_m, WORLD_SIZE_M, WORLD_SIZE_M, fill_color=None, line_color=palette.GREY)


def _columns(rows: Iterable[Row], *names: str) -> ColumnDataSource:
    table = np.array(list(rows), dtype=np.float64).reshape(-1, len(names))
    return source(**dict(zip(names, table.T, strict=True)))


def _trunks(forest: Forest) -> Iterator[Row]:
    for trunk, diameter_m in forest.thick_trunks:
        east_m, north_m = trunk.x1_m - trunk.x0_m, trunk.y1_m - trunk.y0_m
        middle_m = trunk.x0_m + east_m / 2.0, trunk.y0_m + north_m / 2.0
        yield *middle_m, hypot(east_m, north_m), diameter_m, atan2(north_m, east_m)


def _trunk_ends(forest: Forest) -> Iterator[Row]:
    for trunk, diameter_m in forest.thick_trunks:
        yield trunk.x0_m, trunk.y0_m, diameter_m / 2.0
        yield trunk.x1_m, trunk.y1_m, diameter_m / 2.0
