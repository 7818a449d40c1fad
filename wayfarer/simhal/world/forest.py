"""Data of a simulated forest: fallen trunks, standing trees, a start and a goal line.

x points east and y north, in metres; headings are degrees clockwise from north.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, radians
from typing import Annotated, Literal, NamedTuple

from annotated_types import Interval

from wayfarer.angles import axis_offset_deg
from wayfarer.errors import BadForest
from wayfarer.fieldlog import record

WORLD_SIZE_M = record.WORLD_SIZE_M
TREES_PER_HA = 80.0  # paper, section IV-A
SHORTEST_TRUNK_M = 0.0005  # half of the millimetre that files are rounded to
ROVER_WIDTH_M = 0.4  # paper, section IV-A: the footprint is a square of 0.4 m
ROVER_REACH_M = hypot(ROVER_WIDTH_M, ROVER_WIDTH_M) / 2.0  # 0.283 m, centre to corner: room to turn on the spot
ALONG_GOAL_DEG = 20.0  # paper, OO-Pledge: a trunk within 20 degrees of the goal heading can be followed

Lean = Literal["right", "left", "across"]
Coordinate = Annotated[float, Interval(ge=0, le=WORLD_SIZE_M)]

# Files give whole millimetres: both ends of a short trunk may be off by half of one in x and in y.
_ROUNDING_M = 0.002


class Trunk(NamedTuple):
    """The centre line of a fallen branch.

    ``lean`` is the orientation class that the OO algorithms of the paper see: ``right`` or ``left`` within 20
    degrees of the goal heading (clockwise or counter-clockwise of it), ``across`` otherwise.
    """

    x0_m: Coordinate
    y0_m: Coordinate
    x1_m: Coordinate
    y1_m: Coordinate
    lean: Lean

    @property
    def length_m(self) -> float:
        """Return the length of the centre line, metres."""
        return hypot(self.x1_m - self.x0_m, self.y1_m - self.y0_m)

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Return the distance from a point to the centre line, metres; a trunk of no length has none."""
        dx_m, dy_m = self.x1_m - self.x0_m, self.y1_m - self.y0_m
        along = ((x_m - self.x0_m) * dx_m + (y_m - self.y0_m) * dy_m) / (dx_m * dx_m + dy_m * dy_m)
        along = min(1.0, max(0.0, along))
        return hypot(x_m - self.x0_m - along * dx_m, y_m - self.y0_m - along * dy_m)


@dataclass(frozen=True, slots=True)
class Forest:
    """One forest: the geometry of a trial, without the noise that happens in it.

    ``forest`` numbers the layout of fallen trunks, ``noise`` the draw of standing trees (and of all noise) in
    it. A trunk reaches half of ``trunk_diameter_m`` from its centre line, around its ends too.
    ``shortest_path_m`` is the geodesic for the rover of a trial, and in a file for one ``ROVER_WIDTH_M`` wide; None if
    it was not computed. ``diameters_m`` has a thickness for each trunk if they differ, and nothing if all have
    ``trunk_diameter_m``.
    """

    forest: int
    noise: int
    start_m: tuple[float, float]
    heading_deg: float
    goal_y_m: float
    trunk_diameter_m: float
    tree_radius_m: float
    trunks: tuple[Trunk, ...]
    trees_m: tuple[tuple[float, float], ...]
    shortest_path_m: float | None = None
    diameters_m: tuple[float, ...] = ()

    @property
    def thick_trunks(self) -> list[tuple[Trunk, float]]:
        """Each trunk with its diameter, metres."""
        return list(zip(self.trunks, self.diameters_m or (self.trunk_diameter_m,) * len(self.trunks), strict=True))

    def gaps_m(self, x_m: float, y_m: float) -> Iterator[float]:
        """Yield the distance from a point to the surface of each trunk and each tree, metres; negative inside it."""
        for trunk, diameter_m in self.thick_trunks:
            yield trunk.distance_m(x_m, y_m) - diameter_m / 2.0
        for tree_x_m, tree_y_m in self.trees_m:
            yield hypot(x_m - tree_x_m, y_m - tree_y_m) - self.tree_radius_m


CLEARING = Forest(0, 0, (25.0, 12.5), 0.0, 50.0, 0.3, 0.25, (), ())
"""Nothing in it, and a goal line; it has no edge."""


def check_forest(forest: Forest) -> None:
    """Refuse a forest in which no trial can be run; each number is taken to be within its own range.

    Raises:
        BadForest: the text names the key, what is wrong and what was expected.
    """
    if forest.diameters_m and len(forest.diameters_m) != len(forest.trunks):
        raise BadForest(f"diameters_m: expected one for each of the {len(forest.trunks)} trunks")
    if not forest.start_m[1] < forest.goal_y_m:
        raise BadForest(f"goal_y_m: is {forest.goal_y_m:g}, expected north of the start at {forest.start_m[1]:g} m")
    if cos(radians(forest.heading_deg)) <= 1e-9:
        raise BadForest(
            f"heading_deg: is {forest.heading_deg:g}, expected below 90 or above 270: the goal line lies north"
        )
    for index, trunk in enumerate(forest.trunks):
        _check_trunk(f"trunks_m[{index}]", trunk, forest.heading_deg)
    _check_start_is_free(forest)


def _check_trunk(key: str, trunk: Trunk, heading_deg: float) -> None:
    """Refuse a trunk of no length, or whose lean is not that of its centre line."""
    if trunk.length_m < SHORTEST_TRUNK_M:
        raise BadForest(
            f"{key}: has no length, both ends are ({trunk.x0_m:g}, {trunk.y0_m:g}), "
            "expected two ends at least 1 mm apart"
        )
    axis_deg = degrees(atan2(trunk.x1_m - trunk.x0_m, trunk.y1_m - trunk.y0_m))
    offset_deg = axis_offset_deg(axis_deg, heading_deg)
    if _lean_error_deg(trunk.lean, offset_deg) > degrees(atan2(_ROUNDING_M, trunk.length_m)):
        side = "clockwise" if offset_deg > 0.0 else "counter-clockwise"
        raise BadForest(
            f"{key}: lean is '{trunk.lean}', but the trunk lies {abs(offset_deg):.1f} degrees {side} "
            f"of the goal heading; expected '{lean_of(offset_deg)}'"
        )


def _lean_error_deg(lean: Lean, offset_deg: float) -> float:
    """Return how far a trunk would have to turn for its lean to be true; 0 or less if it is."""
    if lean == "across":
        return ALONG_GOAL_DEG - abs(offset_deg)
    to_its_side_deg = offset_deg if lean == "right" else -offset_deg
    return max(-to_its_side_deg, to_its_side_deg - ALONG_GOAL_DEG)


def lean_of(offset_deg: float) -> Lean:
    """Return the lean of a trunk at a signed angle in [-90, 90) from the goal heading, clockwise positive."""
    if abs(offset_deg) > ALONG_GOAL_DEG:
        return "across"
    return "right" if offset_deg > 0.0 else "left"


def _check_start_is_free(forest: Forest) -> None:
    """Refuse a start where a rover turning on the spot would hit something."""
    for index, gap_m in enumerate(forest.gaps_m(*forest.start_m)):
        if gap_m <= ROVER_REACH_M:
            tree = index - len(forest.trunks)
            name = f"trunks_m[{index}]" if tree < 0 else f"trees_m[{tree}]"
            raise BadForest(
                f"start_m: {name} is {gap_m:.3f} m from the centre of the rover, expected more than "
                f"{ROVER_REACH_M:.3f} m (its corners); it lacks {ROVER_REACH_M - gap_m:.3f} m"
            )
