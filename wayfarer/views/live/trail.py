"""The path of the rover, thinned so that hours of it fit a telephone. Pure."""

from __future__ import annotations

from math import dist

MOST_POINTS = 3000  # some 75 kB for a new viewer; 150 m at the first spacing, 1.2 km at the fourth
SPACING_M = 0.05  # less than the line is wide
MOVED_M = 0.005  # a change of phase on the spot is no piece of the way

Point = tuple[float, float, str]  # metres east and north, and the phase in which the rover came there


class Trail:
    """Keeps points at least a spacing apart; when they are too many every other one goes, and the spacing doubles."""

    def __init__(self, most: int = MOST_POINTS, spacing_m: float = SPACING_M) -> None:
        self._most = most
        self._spacing_m = spacing_m
        self.points: list[Point] = []

    def add(self, east_m: float, north_m: float, phase: str) -> bool:
        """Take where the rover is; return whether that became a point."""
        if self.points:
            before_east_m, before_north_m, before_phase = self.points[-1]
            moved_m = dist((before_east_m, before_north_m), (east_m, north_m))
            if moved_m < (self._spacing_m if phase == before_phase else MOVED_M):
                return False
        self.points.append((round(east_m, 3), round(north_m, 3), phase))
        return True

    def thin(self) -> bool:
        """Keep every other point if there are too many; return whether that was so."""
        if len(self.points) <= self._most:
            return False
        self.points = self.points[:-1:2] + self.points[-1:]
        self._spacing_m *= 2.0
        return True
