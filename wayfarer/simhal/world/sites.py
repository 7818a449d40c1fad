"""Emulated sites of the paper's field trials (section IV-C): ``wayfarer sim --site``.

The paper shows them in photographs and gives no measures: all lengths here are chosen by us, by the look of
such places. ``docs/explanation/scenarios.md`` says what follows from that. A layout is drawn from a seed: branches one
by one, then trees where there is room.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count
from math import atan2, cos, degrees, hypot, pi, radians, sin, sqrt
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
# more, as if it could drive over nothing. A wider or longer rover still gets other layouts.
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
        """Return the rover, with a receiver if this site's trials log positions."""
        if not self.has_receiver or "position" in rover.parts:
            return rover
        return rover.model_copy(update={"parts": {**rover.parts, "position": RECEIVER}})


# -- extended maze: large fallen branches that form barriers, with few gaps and pockets between them -------------------

MAZE_START_M = (25.0, 20.0)
MAZE_AHEAD_M = 7.0  # to the destination line: MiniRover took 51 s (paper), in which it drives 15 m at most
BARRIERS_M = (1.5, 3.3, 5.1)  # ahead of the start, give or take
MAZE_SHIFT_M = 0.3
HALF_BARRIER_M = (3.5, 5.5)  # how far a barrier reaches to each side of the start's meridian
MAZE_BRANCH_M = (1.2, 3.5)
MAZE_DIAMETER_M = (0.08, 0.3)
MAZE_MAX_TILT_DEG = 15.0
NARROW_GAP_M = (0.25, 0.45)  # between two branches: MiniRover fits through, ForestRover through few
WIDE_GAP_M = (0.7, 1.3)  # one in each barrier
SPUR_M = (0.8, 1.5)  # a branch that lies along the way before a barrier makes a pocket of it
SPURS = 2  # at each barrier
TWIGS, TWIG_M, TWIG_DIAMETER_M = 12, (0.4, 1.5), (0.01, 0.06)
SOUTH_M = 2.0  # behind the start there is clutter as well
MAZE_TREES = 8


def lay_maze(draw: Draw) -> SiteLayout:
    """Draw the ground of one layout."""
    ground = SiteLayout(MAZE_START_M, MAZE_AHEAD_M)
    for ahead_m in BARRIERS_M:
        _lay_barrier(ground, MAZE_START_M[1] + ahead_m + draw(-MAZE_SHIFT_M, MAZE_SHIFT_M), draw)
    around = Box(
        MAZE_START_M[0] - 5.0, MAZE_START_M[1] - SOUTH_M, MAZE_START_M[0] + 5.0, MAZE_START_M[1] + MAZE_AHEAD_M
    )
    for _ in range(TWIGS):
        middle_m = draw(around.west_m, around.east_m), draw(around.south_m, around.north_m)
        ground.lay_branch(middle_m, draw(0.0, 180.0), draw(*TWIG_M), draw(*TWIG_DIAMETER_M))
    ground.place_trees(MAZE_TREES, around, draw, clear_m=1.0)
    return ground


def _lay_barrier(ground: SiteLayout, y_m: float, draw: Draw) -> None:
    """Lay branches from west to east, end to end but for gaps of which one is wide; spurs point back to the start."""
    west_m, east_m = MAZE_START_M[0] - draw(*HALF_BARRIER_M), MAZE_START_M[0] + draw(*HALF_BARRIER_M)
    wide_from_m = draw(west_m + MAZE_BRANCH_M[0], east_m - MAZE_BRANCH_M[0])
    x_m, has_wide_gap = west_m, False
    while x_m < east_m:
        length_m = draw(*MAZE_BRANCH_M)
        middle_m = x_m + length_m / 2.0, y_m + draw(-MAZE_SHIFT_M, MAZE_SHIFT_M) / 2.0
        ground.lay_branch(
            middle_m, 90.0 + draw(-MAZE_MAX_TILT_DEG, MAZE_MAX_TILT_DEG), length_m, draw(*MAZE_DIAMETER_M)
        )
        x_m += length_m
        is_wide = not has_wide_gap and x_m >= wide_from_m
        has_wide_gap |= is_wide
        x_m += draw(*(WIDE_GAP_M if is_wide else NARROW_GAP_M))
    for _ in range(SPURS):
        spur_m = draw(*SPUR_M)
        place_m = draw(west_m, east_m), y_m - spur_m / 2.0
        ground.lay_branch(place_m, draw(-MAZE_MAX_TILT_DEG, MAZE_MAX_TILT_DEG), spur_m, draw(*MAZE_DIAMETER_M))


EXTENDED_MAZE = FieldSite("extended-maze", 300.0, lay_maze)


# -- dense obstruction: the rover starts in the middle of tightly cluttered fallen branches ----------------------------

CLUTTER_START_M = (25.0, 20.0)
CLUTTER_AHEAD_M = 5.0  # to the destination line, beyond the clutter
CLUTTER_CLEAR_M = 0.5  # room in the middle for the rover to turn
FENCE, FENCE_FROM_M, FENCE_BRANCH_M = 8, (0.8, 1.3), (0.5, 1.0)  # branches that lie across each way out of there
CLUTTER_MAX_TILT_DEG = 40.0
RING_M = (1.2, 4.0)  # where the middles of the other branches lie
CLUTTER_BRANCHES = 55  # 1.2 in a square metre
CLUTTER_BRANCH_M = (0.4, 2.0)
CLUTTER_DIAMETER_M = (0.02, 0.14)
CLUTTER_TREES = 4


def lay_clutter(draw: Draw) -> SiteLayout:
    """Draw the ground of one layout."""
    ground = SiteLayout(CLUTTER_START_M, CLUTTER_AHEAD_M)
    for number in range(FENCE):
        bearing_deg = (number + draw(0.0, 1.0)) * 360.0 / FENCE
        place_m = _away(draw(*FENCE_FROM_M), radians(bearing_deg))
        across_deg = bearing_deg + 90.0 + draw(-CLUTTER_MAX_TILT_DEG, CLUTTER_MAX_TILT_DEG)
        ground.lay_branch(place_m, across_deg, draw(*FENCE_BRANCH_M), draw(*CLUTTER_DIAMETER_M))
    for _ in range(CLUTTER_BRANCHES):
        # In the ring any square metre is as likely as any other.
        from_start_m = sqrt(draw(RING_M[0] * RING_M[0], RING_M[1] * RING_M[1]))
        place_m = _away(from_start_m, draw(0.0, 2.0 * pi))
        ground.lay_branch(place_m, draw(0.0, 180.0), draw(*CLUTTER_BRANCH_M), draw(*CLUTTER_DIAMETER_M))
    ground.keep_free(CLUTTER_CLEAR_M)
    x_m, y_m = CLUTTER_START_M
    around = Box(x_m - RING_M[1], y_m - RING_M[1], x_m + RING_M[1], y_m + RING_M[1])
    ground.place_trees(CLUTTER_TREES, around, draw, clear_m=1.2)
    return ground


def _away(distance_m: float, bearing_rad: float) -> tuple[float, float]:
    return CLUTTER_START_M[0] + distance_m * sin(bearing_rad), CLUTTER_START_M[1] + distance_m * cos(bearing_rad)


DENSE_OBSTRUCTION = FieldSite("dense-obstruction", 300.0, lay_clutter)


# -- forest escape: 45 m of woodland to a path, with GPS for the log ---------------------------------------------------

WOOD_START_M = (25.0, 2.5)
WOOD_AHEAD_M = 45.0  # paper: the shortest distance to the path
WOOD = Box(0.5, 0.5, WORLD_SIZE_M - 0.5, WORLD_SIZE_M - 0.5)
WOOD_TREES = 100  # 400 a hectare: an open broad-leaved wood; the paper's simulation has 80
LARGE, LARGE_M, LARGE_DIAMETER_M = 40, (2.0, 7.0), (0.08, 0.3)
SMALL, SMALL_M, SMALL_DIAMETER_M = 120, (0.4, 2.0), (0.01, 0.1)
WOOD_CLEAR_M = 0.6


def lay_wood(draw: Draw) -> SiteLayout:
    """Draw the ground of one layout."""
    ground = SiteLayout(WOOD_START_M, WOOD_AHEAD_M)
    for number, length_m, diameter_m in ((LARGE, LARGE_M, LARGE_DIAMETER_M), (SMALL, SMALL_M, SMALL_DIAMETER_M)):
        for _ in range(number):
            middle_m = draw(WOOD.west_m, WOOD.east_m), draw(WOOD.south_m, WOOD.north_m)
            ground.lay_branch(middle_m, draw(0.0, 180.0), draw(*length_m), draw(*diameter_m))
    ground.keep_free(WOOD_CLEAR_M)
    ground.place_trees(WOOD_TREES, WOOD, draw, clear_m=1.5)
    return ground


FOREST_ESCAPE = FieldSite("forest-escape", 900.0, lay_wood, has_receiver=True)

SITES: Mapping[str, FieldSite] = {site.name: site for site in (EXTENDED_MAZE, DENSE_OBSTRUCTION, FOREST_ESCAPE)}
