"""The path of a frame on the map: what was driven so far, and when to draw it again. Pure."""

from __future__ import annotations

from wayfarer.views.trail import Trail

POINTS = 1000  # at most: 20 kB a message, and drawn again in a fraction of a millisecond
SPACING_M = 0.1  # of the first hundred metres: a quarter of a rover's length
DRAW_EVERY_S = 1.0  # a path is drawn whole each time, so that the newest message is all that a viewer needs


class DrawnPath(Trail):
    """A path that is drawn now and then."""

    def __init__(self) -> None:
        super().__init__(POINTS, SPACING_M)
        self._drawn_s = float("-inf")
        self._grown = False

    def grow(self, x_m: float, y_m: float) -> None:
        """Lengthen the path."""
        self._grown |= self.add(x_m, y_m)
        self.thin()

    def is_due(self, t_s: float) -> bool:
        """Return whether it has grown and is due to be drawn; then it counts as drawn."""
        due = self._grown and t_s >= self._drawn_s + DRAW_EVERY_S
        if due:
            self._drawn_s, self._grown = t_s, False
        return due
