"""The path of the rover, thinned so that hours of it can be sent and drawn. Pure."""

from __future__ import annotations

from math import dist

MOVED_M = 0.005  # a change of phase on the spot is not a piece of the path

Point = tuple[float, float, str]  # metres east and north, and the phase in which the rover came there


class Trail:
    """Points of a path, at least a spacing apart; when there are too many, every other one is dropped.

    Then the spacing doubles, so that a path twice as long is drawn half as finely.

    Args:
        most: the number of points after ``thin``.
        spacing_m: the spacing at first.
    """

    def __init__(self, most: int, spacing_m: float) -> None:
        self._most = most
        self.spacing_m = spacing_m
        self.points: list[Point] = []

    def add(self, east_m: float, north_m: float, phase: str = "") -> bool:
        """Take where the rover is; return whether that became a point."""
        if self.points:
            before_east_m, before_north_m, before_phase = self.points[-1]
            moved_m = dist((before_east_m, before_north_m), (east_m, north_m))
            if moved_m < (self.spacing_m if phase == before_phase else MOVED_M):
                return False
        self.points.append((east_m, north_m, phase))
        return True

    def thin(self) -> bool:
        """Keep every other point if there are too many; return whether that was so."""
        if len(self.points) <= self._most:
            return False
        self.points = self.points[:-1:2] + self.points[-1:]
        self.spacing_m *= 2.0
        return True
