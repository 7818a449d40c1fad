"""Poses and paths on the map: by dead reckoning, and true ones of a simulated run. Pure."""

from __future__ import annotations

from wayfarer.fieldlog.dead_reckoning import DeadReckoning, ReckonedPose
from wayfarer.fieldlog.reader import Record
from wayfarer.views.foxglove.scene import ROVER, TRUTH
from wayfarer.views.trail import Trail

PATH_POINTS = 1000  # at most: 20 kB a message, and drawn again in a fraction of a millisecond
PATH_SPACING_M = 0.1  # of the first hundred metres: a quarter of a rover's length
DRAW_EVERY_S = 1.0  # a path is drawn whole each time, so that the newest message is all that a viewer needs


class Places:
    """Follows the records of one run.

    The map's origin is where the log begins; in a simulated run it is the forest's, and the log begins at its start.
    ``header`` is the log's first record, empty where there is none. ``paths`` are what was driven, by frame.
    """

    def __init__(self) -> None:
        self.header: Record = {}
        self.paths = {frame: Trail(PATH_POINTS, PATH_SPACING_M) for frame in (ROVER, TRUTH)}
        self._reckoning = DeadReckoning({})
        self._start_m = (0.0, 0.0)
        self._drawn_s = dict.fromkeys(self.paths, float("-inf"))
        self._grown = dict.fromkeys(self.paths, False)

    @property
    def path_m(self) -> float:
        """Return how far the rover went by dead reckoning."""
        return self._reckoning.path_m

    def take(self, record: Record) -> ReckonedPose | None:
        """Take the next record; of a tick return the place in the map, as a simulated forest has it."""
        match record["record"]:
            case "run" if not self.header:
                self._begin(record)
            case "truth":
                self._grow(TRUTH, record["x_m"], record["y_m"])
            case "tick" if place := self._reckoning.take(record):
                east_m, north_m = self._start_m
                place = place._replace(east_m=place.east_m + east_m, north_m=place.north_m + north_m)
                self._grow(ROVER, place.east_m, place.north_m)
                return place
        return None

    def is_due(self, frame: str, t_s: float) -> bool:
        """Return whether a path has grown and is due to be drawn; then it counts as drawn."""
        due = self._grown[frame] and t_s >= self._drawn_s[frame] + DRAW_EVERY_S
        if due:
            self._drawn_s[frame] = t_s
            self._grown[frame] = False
        return due

    def _begin(self, header: Record) -> None:
        self.header = header
        if "world" in header:
            east_m, north_m = header["world"]["start_m"]
            self._start_m = (float(east_m), float(north_m))
        if self._reckoning.place is None:
            self._reckoning = DeadReckoning(header)

    def _grow(self, frame: str, x_m: float, y_m: float) -> None:
        self._grown[frame] |= self.paths[frame].add(x_m, y_m)
        self.paths[frame].thin()
