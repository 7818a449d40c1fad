"""The shortest path out of a known forest, the reference for a trial's path length.

Fast marching on a grid: obstacles grow by half the rover's width, a wave starts at the rover, and its arrival
at the goal line gives the length of the shortest path of a point. The path stays inside the world. ``has_path`` asks
the same grid only whether there is a path, which needs no fast marching (the extra ``spl``).

In the open a length is right to 0.02 m. The lengths in the file of reference forests are 0.14 m shorter: they
run from the edge of one cell, at (25.05, 12.55), to the middle of the last row of cells, at y = 49.95 m.
"""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from wayfarer.simhal.world.forest import ROVER_WIDTH_M, WORLD_SIZE_M, Forest

CELL_M = 0.1  # the grid of the reference forests' shortest paths
SOURCE_RADIUS_M = 0.2  # the wave starts as a circle: fast marching is poor around a single point

# Four in five shortest paths are at most this much longer than the straight one. Looking first only where a
# path of that length can lead halves the time.
LIKELY_DETOUR = 1.1

CENTRES_M = np.arange(CELL_M / 2.0, WORLD_SIZE_M, CELL_M)  # of the cells, along x and along y
EVERY = slice(None)

Lengths = NDArray[np.float64]  # of each cell, [row from the south, column from the west]
Mask = NDArray[np.bool_]


def shortest_path_m(forest: Forest, rover_width_m: float = ROVER_WIDTH_M) -> float | None:
    """Return the length of the shortest path from start to goal line, metres; None when there is no path.

    ``rover_width_m`` is the width of the narrowest gap that the rover fits through, at least 0.
    """
    from_start_m = _from_start_m(forest)
    blocked = _blocked(forest, rover_width_m / 2.0)

    likely_m = LIKELY_DETOUR * (forest.goal_y_m - forest.start_m[1])
    too_far = from_start_m + np.abs(forest.goal_y_m - CENTRES_M[:, np.newaxis]) > likely_m
    length_m = _march_m(from_start_m, blocked | too_far, forest.goal_y_m)
    if length_m > likely_m:
        length_m = _march_m(from_start_m, blocked, forest.goal_y_m)
    return length_m if length_m < inf else None


def has_path(forest: Forest, rover_width_m: float = ROVER_WIDTH_M) -> bool:
    """Return whether ``shortest_path_m`` is a length, in a twentieth of the time."""
    from scipy import ndimage

    regions, _ = ndimage.label(~_blocked(forest, rover_width_m / 2.0))  # 0 if it is blocked
    (x_m, y_m), reach_m = forest.start_m, SOURCE_RADIUS_M + CELL_M
    around = _near(y_m, y_m, reach_m), _near(x_m, x_m, reach_m)  # to measure all of the world would take longer
    started = regions[around][_from_start_m(forest, *around) <= SOURCE_RADIUS_M]
    return bool(np.intersect1d(started[started > 0], regions[_last_row(forest.goal_y_m)]).size)


def _from_start_m(forest: Forest, rows: slice = EVERY, columns: slice = EVERY) -> Lengths:
    """Return how far the middle of each cell is from the start, metres."""
    x_m, y_m = forest.start_m
    return np.hypot(CENTRES_M[columns] - x_m, CENTRES_M[rows, np.newaxis] - y_m)


def _last_row(goal_y_m: float) -> int:
    """Return the last row of cells before the goal line."""
    return max(0, int(np.searchsorted(CENTRES_M, goal_y_m)) - 1)


def _march_m(from_start_m: Lengths, closed: Mask, goal_y_m: float) -> float:
    """Return the length of the shortest path through cells that are not closed; infinite for none."""
    import skfmm

    try:
        wave_m = skfmm.distance(np.ma.MaskedArray(from_start_m - SOURCE_RADIUS_M, closed), dx=CELL_M)
    except ValueError:  # the wave has no cell to start from, or none to go to
        return inf
    travelled_m = np.ma.filled(wave_m, inf)  # infinite where the wave does not come
    last_row = _last_row(goal_y_m)
    arrival_m = float(travelled_m[last_row].min())
    return arrival_m + SOURCE_RADIUS_M + goal_y_m - float(CENTRES_M[last_row])


def _blocked(forest: Forest, half_width_m: float) -> Mask:
    """Return the cells that the centre of a rover of that half width cannot be in."""
    blocked = np.zeros((len(CENTRES_M), len(CENTRES_M)), dtype=bool)
    tree_reach_m = forest.tree_radius_m + half_width_m
    for (x0_m, y0_m, x1_m, y1_m, _), diameter_m in forest.thick_trunks:
        _block(blocked, (x0_m, y0_m), (x1_m, y1_m), diameter_m / 2.0 + half_width_m)
    for tree_m in forest.trees_m:
        _block(blocked, tree_m, tree_m, tree_reach_m)
    return blocked


def _block(blocked: Mask, end0_m: tuple[float, float], end1_m: tuple[float, float], reach_m: float) -> None:
    """Mark the cells within reach of a line between two ends, which may coincide."""
    (x0_m, y0_m), (x1_m, y1_m) = end0_m, end1_m
    columns = _near(x0_m, x1_m, reach_m)
    rows = _near(y0_m, y1_m, reach_m)
    x_m = CENTRES_M[columns] - x0_m
    y_m = CENTRES_M[rows, np.newaxis] - y0_m
    dx_m, dy_m = x1_m - x0_m, y1_m - y0_m
    square_m2 = dx_m * dx_m + dy_m * dy_m
    along = np.clip((x_m * dx_m + y_m * dy_m) / square_m2, 0.0, 1.0) if square_m2 else 0.0
    blocked[rows, columns] |= np.hypot(x_m - along * dx_m, y_m - along * dy_m) <= reach_m


def _near(end0_m: float, end1_m: float, reach_m: float) -> slice:
    """Return the cells of one axis that lie between two ends or within reach of one."""
    low_m, high_m = min(end0_m, end1_m) - reach_m, max(end0_m, end1_m) + reach_m
    return slice(int(np.searchsorted(CENTRES_M, low_m)), int(np.searchsorted(CENTRES_M, high_m)))
