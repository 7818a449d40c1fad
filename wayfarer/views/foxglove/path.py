"""A path of bounded size, for drawing. Pure."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import Generic, TypeVar

POINTS = 1000  # at most: 20 kB a message, and redrawn in a fraction of a millisecond
SPACING_M = 0.1  # of the first hundred metres: a quarter of a rover's length

Point = TypeVar("Point")


class ThinnedPath(Generic[Point]):
    """Keeps a path from its beginning to its end in at most ``most`` points, however long it becomes.

    A point is kept when it is ``spacing_m`` from the one kept before it. Where there are too many, every second one
    goes and the spacing doubles: a path that is twice as long is drawn half as finely.

    Args:
        make: makes what is drawn of x and y, once for each point that is kept.
        most: points to keep.
        spacing_m: their distance at first.
    """

    def __init__(self, make: Callable[[float, float], Point], most: int = POINTS, spacing_m: float = SPACING_M) -> None:
        self._make = make
        self._most = most
        self._last_m: tuple[float, float] | None = None
        self.spacing_m = spacing_m
        self.points: list[Point] = []

    def take(self, x_m: float, y_m: float) -> bool:
        """Take where the rover is now, and say whether that point was kept."""
        if self._last_m is not None and hypot(x_m - self._last_m[0], y_m - self._last_m[1]) < self.spacing_m:
            return False
        if len(self.points) == self._most:
            del self.points[1::2]
            self.spacing_m *= 2.0
        self._last_m = (x_m, y_m)
        self.points.append(self._make(x_m, y_m))
        return True
