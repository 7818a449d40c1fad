"""Poses and paths on the map: by dead reckoning, and true ones of a simulated run. Pure."""

from __future__ import annotations

from wayfarer.fieldlog.dead_reckoning import ReckonedPose
from wayfarer.fieldlog.header import Header
from wayfarer.views.foxglove.scene import ROVER, TRUTH
from wayfarer.views.trail import Trail

PATH_POINTS = 1000  # at most: 20 kB a message, and drawn again in a fraction of a millisecond
PATH_SPACING_M = 0.1  # of the first hundred metres: a quarter of a rover's length
DRAW_EVERY_S = 1.0  # a path is drawn whole each time, so that the newest message is all that a viewer needs


class Places:
    """Lays the run on the map.

    The map's origin is where the log begins; in a simulated run it is the forest's, and the log begins at its start.
    ``paths`` are what was driven, by frame.
    """

    def __init__(self) -> None:
        self.paths = {frame: Trail(PATH_POINTS, PATH_SPACING_M) for frame in (ROVER, TRUTH)}
        self._start_m = (0.0, 0.0)
        self._drawn_s = dict.fromkeys(self.paths, float("-inf"))
        self._grown = dict.fromkeys(self.paths, False)

    def begin(self, header: Header) -> None:
        """Take what says in which forest the run is."""
        if header.world is not None:
            east_m, north_m, *_ = header.world["start_m"]
            self._start_m = (float(east_m), float(north_m))

    def in_map(self, place: ReckonedPose) -> ReckonedPose:
        """Return a place of dead reckoning in the map."""
        east_m, north_m = self._start_m
        return place._replace(east_m=place.east_m + east_m, north_m=place.north_m + north_m)

    def grow(self, frame: str, x_m: float, y_m: float) -> None:
        """Lengthen a path."""
        self._grown[frame] |= self.paths[frame].add(x_m, y_m)
        self.paths[frame].thin()

    def is_due(self, frame: str, t_s: float) -> bool:
        """Return whether a path has grown and is due to be drawn; then it counts as drawn."""
        due = self._grown[frame] and t_s >= self._drawn_s[frame] + DRAW_EVERY_S
        if due:
            self._drawn_s[frame] = t_s
            self._grown[frame] = False
        return due
