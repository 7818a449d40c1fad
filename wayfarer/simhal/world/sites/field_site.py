"""A site: its time limit, and layouts from a seed, built of branches one by one, then of trees where there is room."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from math import atan2, cos, degrees, hypot, radians, sin
from zlib import crc32

from wayfarer.angles import axis_offset_deg, clamp
from wayfarer.config.rover_file import RoverConfig
from wayfarer.escape.settings import Vehicle
from wayfarer.simhal.world.collision import Box
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest, Trunk, lean_of
from wayfarer.simhal.world.generate import TREE_RADIUS_M, TRUNK_DIAMETER_M, Draw, draw_from
from wayfarer.simhal.world.shortest_path import has_path

GOAL_HEADING_DEG = 0.0  # north, as in the abstract forests
SITE_STREAM = 3  # beside those of generate.py
# Layouts are the same for both rovers of the paper: there is to be a way for the wider one of them and a hand's breadth
# more, as if it could drive over nothing. A wider rover still has its own layouts.
WIDEST = Vehicle(length_m=0.437, width_m=0.377, track_m=0.47, max_speed_m_s=1.4)  # paper, table II: ForestRover
SPARE_M = 0.1
RECEIVER = {"driver": "gpsd"}


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


@dataclass(frozen=True, slots=True)
class FieldSite:
    """A site by its ``name``; ``lay`` draws the ground of one layout, which may turn out to be closed.

    A rover that is not out after ``time_limit_s`` counts as entrapped: the paper gives no limit for its field trials,
    and its slowest successes took some 230 s. ``has_receiver`` says that positions are logged.
    """

    name: str
    time_limit_s: float
    lay: Callable[[Draw], SiteLayout]
    has_receiver: bool = False

    def layout(self, number: int, seed: int, vehicle: Vehicle) -> Forest:
        """Return a layout on which the body starts free and a path to the goal line exists; always the same.

        Raises:
            ValueError: a negative number.
        """
        width_m = max(vehicle.width_m, WIDEST.width_m) + SPARE_M
        reach_m = hypot(width_m, max(vehicle.length_m, WIDEST.length_m)) / 2.0
        stream = crc32(self.name.encode())  # no two sites share one
        for attempt in count():
            forest = self.lay(draw_from(seed, SITE_STREAM, stream, number, attempt)).as_forest(number)
            can_turn = all(gap_m > reach_m for gap_m in forest.gaps_m(*forest.start_m))
            if can_turn and has_path(forest, width_m):
                return forest
        raise AssertionError("unreachable: the attempts do not end")

    def equip(self, rover: RoverConfig) -> RoverConfig:
        """Return the rover with a receiver where this site's trials log positions."""
        if not self.has_receiver or "position" in rover.parts:
            return rover
        return rover.model_copy(update={"parts": {**rover.parts, "position": RECEIVER}})
