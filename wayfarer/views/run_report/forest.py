"""Forests seen from above, to scale."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from math import atan2, hypot
from typing import Any

import numpy as np
from bokeh.plotting import ColumnDataSource

from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.views import palette
from wayfarer.views.page.plots import Figure, source

Row = tuple[float, ...]


def draw_forests(map_: Figure, forests: Sequence[Forest]) -> None:
    """Draw trunks with their round ends, trees, goal lines, and the edges of the worlds.

    The column ``number`` has the number of the forest, by which a filter shows one of many.
    """

    def columns(rows_of: Callable[[Forest], Iterable[Row]], *names: str) -> ColumnDataSource:
        rows = [(number, *row) for number, forest in enumerate(forests) for row in rows_of(forest)]
        table = np.array(rows, dtype=np.float64).reshape(-1, 1 + len(names))
        return source(**dict(zip(("number", *names), table.T, strict=True)))

    trunk: Any = {"color": palette.TRUNK, "line_color": None}
    map_.rect(
        "x", "y", "length", "thick", "angle", source=columns(_trunks, "x", "y", "length", "thick", "angle"), **trunk
    )
    map_.circle("x", "y", "radius", source=columns(_trunk_ends, "x", "y", "radius"), **trunk)
    map_.circle("x", "y", "radius", source=columns(_trees, "x", "y", "radius"), color=palette.TREE, line_color=None)
    goals = columns(lambda forest: [(0.0, WORLD_SIZE_M, forest.goal_y_m)], "x", "end", "y")
    map_.segment("x", "y", "end", "y", source=goals, line_color=palette.GOAL_LINE, line_width=3)
    edges = columns(lambda _: [(WORLD_SIZE_M / 2.0, WORLD_SIZE_M)], "middle", "side")
    map_.rect("middle", "middle", "side", "side", source=edges, fill_color=None, line_color=palette.GREY)


def _trunks(forest: Forest) -> Iterator[Row]:
    for trunk, diameter_m in forest.thick_trunks:
        east_m, north_m = trunk.x1_m - trunk.x0_m, trunk.y1_m - trunk.y0_m
        middle_m = trunk.x0_m + east_m / 2.0, trunk.y0_m + north_m / 2.0
        yield *middle_m, hypot(east_m, north_m), diameter_m, atan2(north_m, east_m)


def _trunk_ends(forest: Forest) -> Iterator[Row]:
    for trunk, diameter_m in forest.thick_trunks:
        yield trunk.x0_m, trunk.y0_m, diameter_m / 2.0
        yield trunk.x1_m, trunk.y1_m, diameter_m / 2.0


def _trees(forest: Forest) -> Iterator[Row]:
    return ((*tree_m, forest.tree_radius_m) for tree_m in forest.trees_m)
