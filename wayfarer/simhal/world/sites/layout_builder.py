"""Builds the layout of a site: branches one by one, then trees where there is room."""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, radians, sin

from wayfarer.angles import axis_offset_deg
from wayfarer.clamp import clamp
from wayfarer.simhal.world.collision import Box
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest, Trunk, lean_of
from wayfarer.simhal.world.generate import TREE_RADIUS_M, TRUNK_DIAMETER_M, Draw

GOAL_HEADING_DEG = 0.0  # north, as in the abstract forests


class SiteLayout:
    """Branches and trees around a start, with a goal line ``ahead_m`` north of it. Metres, and degrees from north."""

    def __init__(self, start_m: tuple[float, float], ahead_m: float) -> None:
        self.start_m = start_m
        self._goal_y_m = start_m[1] + ahead_m
        self._branches: list[tuple[Trunk, float]] = []
        self._trees_m: list[tuple[float, float]] = []

    def lay_branch(self, middle_m: tuple[float, float], bearing_deg: float, length_m: float, diameter_m: float) -> None:
        """Lay a branch; its ends are on whole millimetres and inside the world, and so is its thickness."""
        east_m, north_m = (f(radians(bearing_deg)) * length_m / 2.0 for f in (sin, cos))
        x_m, y_m = middle_m
        ends = (x_m - east_m, y_m - north_m, x_m + east_m, y_m + north_m)
        x0_m, y0_m, x1_m, y1_m = (round(clamp(end_m, 0.0, WORLD_SIZE_M), 3) for end_m in ends)
        axis_deg = degrees(atan2(x1_m - x0_m, y1_m - y0_m))  # an end that was cut off at the edge has turned it
        lean = lean_of(axis_offset_deg(axis_deg, GOAL_HEADING_DEG))
        self._branches.append((Trunk(x0_m, y0_m, x1_m, y1_m, lean), round(diameter_m, 3)))

    def keep_free(self, radius_m: float) -> None:
        """Take away every branch that reaches within a radius of the start."""
        self._branches = [
            (trunk, diameter_m)
            for trunk, diameter_m in self._branches
            if trunk.distance_m(*self.start_m) > radius_m + diameter_m / 2.0
        ]

    def place_trees(self, count: int, within: Box, draw: Draw, clear_m: float) -> None:
        """Stand trees that touch nothing and leave the start a clearing of radius ``clear_m``.

        A place that has no room is left empty: dense ground has fewer trees.
        """
        for _ in range(count):
            x_m, y_m = round(draw(within.west_m, within.east_m), 3), round(draw(within.south_m, within.north_m), 3)
            is_far = hypot(x_m - self.start_m[0], y_m - self.start_m[1]) > clear_m
            if is_far and all(gap_m > TREE_RADIUS_M for gap_m in self.as_forest(0).gaps_m(x_m, y_m)):
                self._trees_m.append((x_m, y_m))

    def as_forest(self, layout: int) -> Forest:
        """Return all of it as a forest of that number."""
        return Forest(
            forest=layout,
            noise=0,
            start_m=self.start_m,
            heading_deg=GOAL_HEADING_DEG,
            goal_y_m=self._goal_y_m,
            trunk_diameter_m=TRUNK_DIAMETER_M,
            tree_radius_m=TREE_RADIUS_M,
            trunks=tuple(trunk for trunk, _ in self._branches),
            trees_m=tuple(self._trees_m),
            diameters_m=tuple(diameter_m for _, diameter_m in self._branches),
        )
