"""A site: its time limit, and layouts generated from a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from math import hypot

from wayfarer.config.rover_file import RoverConfig
from wayfarer.escape.api import Vehicle
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.generate import Draw, draw_from
from wayfarer.simhal.world.shortest_path import shortest_path_m
from wayfarer.simhal.world.sites.layout_builder import SiteLayout

SITE_STREAM = 3  # beside those of generate.py
# Layouts are the same for both rovers of the paper: there is to be a way for the wider one of them and a hand's breadth
# more, as if it could drive over nothing. A wider rover still has its own layouts.
WIDEST = Vehicle(length_m=0.437, width_m=0.377, track_m=0.47, max_speed_m_s=1.4)  # paper, table II: ForestRover
SPARE_M = 0.1
RECEIVER = {"driver": "gpsd"}


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
        """Return a layout on which the body starts free and a way to the goal line exists; the same for ever.

        Raises:
            ValueError: a negative number.
        """
        width_m = max(vehicle.width_m, WIDEST.width_m) + SPARE_M
        length_m = max(vehicle.length_m, WIDEST.length_m)
        for attempt in count():
            forest = self.lay(draw_from(seed, SITE_STREAM, len(self.name), number, attempt)).as_forest(number)
            if _start_is_free(forest, hypot(width_m, length_m) / 2.0) and shortest_path_m(forest, width_m) is not None:
                return forest
        raise AssertionError("unreachable: the attempts do not end")

    def equip(self, rover: RoverConfig) -> RoverConfig:
        """Return the rover with a receiver where this site's trials log positions."""
        if not self.has_receiver or "position" in rover.parts:
            return rover
        return rover.model_copy(update={"parts": {**rover.parts, "position": RECEIVER}})


def _start_is_free(forest: Forest, reach_m: float) -> bool:
    """Tell whether a body of that reach can turn on the spot at the start."""
    x_m, y_m = forest.start_m
    trunks = all(trunk.distance_m(x_m, y_m) > reach_m + diameter_m / 2.0 for trunk, diameter_m in forest.thick_trunks)
    trees = all(hypot(tree_x - x_m, tree_y - y_m) > reach_m + forest.tree_radius_m for tree_x, tree_y in forest.trees_m)
    return trunks and trees
