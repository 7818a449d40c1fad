"""Collision detection: exact contact tests, and a grid that finds nearby obstacles.

A trunk is a capsule around its centre line, a tree a circle (a capsule of no length). The body is a rectangle.
"""

from __future__ import annotations

from math import atan2, degrees, hypot, sqrt
from typing import Final, NamedTuple

from wayfarer.simhal.world.forest import Forest, Trunk

CELL_M: Final = 2.0
COLUMNS: Final = 1 << 16  # of the map, more than any world has
ROUNDING_M: Final = 1e-9

Span = tuple[float, float]  # part of a line, as shares of its length; (0, 0) is nothing


class Obstacle:
    """A capsule: centre line from (x0, y0) to (x1, y1), radius; ``axis_deg`` is its bearing, None for a tree."""

    def __init__(
        self, x0_m: float, y0_m: float, x1_m: float, y1_m: float, radius_m: float, axis_deg: float | None
    ) -> None:
        self.x0_m, self.y0_m, self.x1_m, self.y1_m = x0_m, y0_m, x1_m, y1_m
        self.radius_m = radius_m
        self.axis_deg = axis_deg
        self._along_x, self._along_y = x1_m - x0_m, y1_m - y0_m
        self._length_sq = self._along_x * self._along_x + self._along_y * self._along_y

    def nearest(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return the point of the centre line that is nearest to a point."""
        x0_m, y0_m, length_sq = self.x0_m, self.y0_m, self._length_sq
        if length_sq == 0.0:
            return x0_m, y0_m
        along_x, along_y = self._along_x, self._along_y
        share = ((x_m - x0_m) * along_x + (y_m - y0_m) * along_y) / length_sq
        share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
        return x0_m + share * along_x, y0_m + share * along_y


def obstacles_of(forest: Forest, clearance_m: float = 0.0) -> list[Obstacle]:
    """Return every tree of a forest, and every trunk that does not pass under a belly of that clearance."""
    trunks = [_lying(trunk, diameter_m) for trunk, diameter_m in forest.thick_trunks if diameter_m > clearance_m]
    return trunks + [Obstacle(x_m, y_m, x_m, y_m, forest.tree_radius_m, None) for x_m, y_m in forest.trees_m]


def low_trunks_of(forest: Forest, clearance_m: float) -> list[Obstacle]:
    """Return every trunk that passes under a belly of that clearance."""
    return [_lying(trunk, diameter_m) for trunk, diameter_m in forest.thick_trunks if diameter_m <= clearance_m]


def _lying(t: Trunk, diameter_m: float) -> Obstacle:
    bearing_deg = degrees(atan2(t.x1_m - t.x0_m, t.y1_m - t.y0_m)) % 180.0  # of an undirected line
    return Obstacle(t.x0_m, t.y0_m, t.x1_m, t.y1_m, diameter_m / 2, bearing_deg)


class Box(NamedTuple):
    """A rectangle that is parallel to the axes, metres."""

    west_m: float
    south_m: float
    east_m: float
    north_m: float


def span_inside(line: tuple[float, float, float, float], box: Box) -> Span:
    """Return the part of a line (x0, y0, x1, y1) that lies inside a box."""
    x0_m, y0_m, x1_m, y1_m = line
    across = span_between(x0_m, x1_m, box.west_m, box.east_m, (0.0, 1.0))
    return span_between(y0_m, y1_m, box.south_m, box.north_m, across)


def span_between(from_m: float, to_m: float, low_m: float, high_m: float, within: Span) -> Span:
    """Return the part of a line in which one of its coordinates is between two bounds, by clipping it (Liang-Barsky).

    ``from_m`` and ``to_m`` are that coordinate at its ends, ``within`` is the part that is asked about.
    """
    enter, leave = within
    if from_m != to_m:
        at_low, at_high = (low_m - from_m) / (to_m - from_m), (high_m - from_m) / (to_m - from_m)
        enter, leave = max(enter, min(at_low, at_high)), min(leave, max(at_low, at_high))
    elif not low_m <= from_m <= high_m:
        return 0.0, 0.0
    return (enter, leave) if enter < leave else (0.0, 0.0)


class BodyOutline:
    """The rover's rectangular outline and its contact test."""

    def __init__(self, length_m: float, width_m: float) -> None:
        self.half_length_m = length_m / 2
        self.half_width_m = width_m / 2
        self.reach_m = hypot(self.half_length_m, self.half_width_m)
        self._inner_m = min(self.half_length_m, self.half_width_m)

    def overlaps(self, obstacle: Obstacle, x_m: float, y_m: float, sin_h: float, cos_h: float) -> bool:
        """Return whether the body, centred at (x, y) and heading where (sin, cos) says, overlaps the obstacle."""
        near_x, near_y = obstacle.nearest(x_m, y_m)
        dx, dy, radius_m = near_x - x_m, near_y - y_m, obstacle.radius_m
        distance_m = sqrt(dx * dx + dy * dy)
        if distance_m > self.reach_m + radius_m:
            return False
        if distance_m < self._inner_m + radius_m:
            return True
        # In the body's frame: forward along the heading, right across it.
        e0, n0 = obstacle.x0_m - x_m, obstacle.y0_m - y_m
        e1, n1 = obstacle.x1_m - x_m, obstacle.y1_m - y_m
        f0, r0 = e0 * sin_h + n0 * cos_h, e0 * cos_h - n0 * sin_h
        f1, r1 = e1 * sin_h + n1 * cos_h, e1 * cos_h - n1 * sin_h
        return self._distance_sq(f0, r0, f1, r1) < radius_m * radius_m

    def _distance_sq(self, f0: float, r0: float, f1: float, r1: float) -> float:
        """Return the squared distance from the body's rectangle to a segment in its own frame, 0 if they cross.

        The nearest pair has an end of the segment or a corner of the rectangle in it, unless they cross.
        """
        df, dr = f1 - f0, r1 - r0
        length_sq = df * df + dr * dr
        if length_sq == 0.0:
            return self._end_distance_sq(f0, r0)
        half_length_m, half_width_m = self.half_length_m, self.half_width_m
        across = span_between(r0, r1, -half_width_m, half_width_m, (0.0, 1.0))
        enter, leave = span_between(f0, f1, -half_length_m, half_length_m, across)
        if enter < leave:
            return 0.0
        best = min(self._end_distance_sq(f0, r0), self._end_distance_sq(f1, r1))
        cf, cr = half_length_m, half_width_m
        for corner in range(4):
            share = ((cf - f0) * df + (cr - r0) * dr) / length_sq
            if 0.0 < share < 1.0:
                gap_f, gap_r = f0 + share * df - cf, r0 + share * dr - cr
                best = min(best, gap_f * gap_f + gap_r * gap_r)
            cr = -cr
            if corner == 1:
                cf = -cf
        return best

    def _end_distance_sq(self, f: float, r: float) -> float:
        gap_f = max(abs(f) - self.half_length_m, 0.0)
        gap_r = max(abs(r) - self.half_width_m, 0.0)
        return gap_f * gap_f + gap_r * gap_r


class ObstacleGrid:
    """Which obstacles are near a place: those whose surface is within ``near_m`` of it, and a few more.

    The smaller the cells of ``cell_m``, the fewer those are; that pays where obstacles are close to each other.
    """

    def __init__(self, obstacles: list[Obstacle], near_m: float, cell_m: float = CELL_M) -> None:
        self._near_m = near_m
        self._cell_m = cell_m
        self._cells: dict[int, list[Obstacle]] = {}  # numbered row by row
        for obstacle in obstacles:
            self._enter(obstacle)

    def _enter(self, obstacle: Obstacle) -> None:
        """List the obstacle in every cell that it may be near to: in each row, beside its part near to that row."""
        x0, y0, x1, y1 = obstacle.x0_m, obstacle.y0_m, obstacle.x1_m, obstacle.y1_m
        cells, cell_m, reach_m = self._cells, self._cell_m, obstacle.radius_m + self._near_m + ROUNDING_M
        for row in range(int((min(y0, y1) - reach_m) // cell_m), int((max(y0, y1) + reach_m) // cell_m) + 1):
            south_m = row * cell_m
            enter, leave = span_between(y0, y1, south_m - reach_m, south_m + cell_m + reach_m, (0.0, 1.0))
            x_in, x_out = x0 + (x1 - x0) * enter, x0 + (x1 - x0) * leave
            first = int((min(x_in, x_out) - reach_m) // cell_m)
            for column in range(first, int((max(x_in, x_out) + reach_m) // cell_m) + 1):
                cells.setdefault(row * COLUMNS + column, []).append(obstacle)

    def near(self, x_m: float, y_m: float) -> list[Obstacle]:
        """Return the obstacles near a point."""
        return self._cells.get(int(y_m // self._cell_m) * COLUMNS + int(x_m // self._cell_m), _NOTHING)


_NOTHING: Final[list[Obstacle]] = []
