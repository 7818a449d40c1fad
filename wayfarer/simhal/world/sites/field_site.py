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
        """Return a layout on which the body starts free and a path to the goal line exists; always the same.

        Raises:
            ValueError: a negative number.
        """
        width_m = max(vehicle.width_m, WIDEST.width_m) + SPARE_M
        reach_m = hypot(width_m, max(vehicle.length_m, WIDEST.length_m)) / 2.0
        for attempt in count():
            forest = self.lay(draw_from(seed, SITE_STREAM, len(self.name), number, attempt)).as_forest(number)
            can_turn = all(gap_m > reach_m for gap_m in forest.gaps_m(*forest.start_m))
            if can_turn and shortest_path_m(forest, width_m) is not None:
                return forest
        raise AssertionError("unreachable: the attempts do not end")

    def equip(self, rover: RoverConfig) -> RoverConfig:
        """Return the rover with a receiver where this site's trials log positions."""
        if not self.has_receiver or "position" in rover.parts:
            return rover
        return rover.model_copy(update={"parts": {**rover.parts, "position": RECEIVER}})
