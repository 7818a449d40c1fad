"""A picture of a forest from above with the way of a rover; drawn with pillow."""

from __future__ import annotations

from math import cos, radians, sin

from PIL import Image, ImageDraw

from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest

WHITE, WOOD, LEAF, WAY = (245, 245, 238), (188, 160, 120), (120, 150, 92), (255, 138, 36)
GROUND = (32, 36, 28)
PICTURE_PX = 480
FINER = 3  # drawn so many times larger, for smooth lines
DOT_PX, NOSE_PX = 3.2, 9.0


class ForestMap:
    """The trunks, trees and goal line of a forest, and the way so far; north is up."""

    def __init__(self, forest: Forest) -> None:
        self._scale = FINER * PICTURE_PX / WORLD_SIZE_M
        self._image = self._draw_forest(forest)
        self._here: tuple[float, float] | None = None

    def go(self, x_m: float, y_m: float) -> None:
        """Lengthen the way to a place, metres east and north."""
        here = self._place(x_m, y_m)
        if self._here is not None:
            ImageDraw.Draw(self._image).line((self._here, here), WAY, 2 * FINER)
        self._here = here

    def draw(self, heading_deg: float) -> Image.Image:
        """Return the map with the rover as a dot and a line ahead."""
        shown = self._image.copy()
        if self._here is not None:
            draw, dot, (x, y) = ImageDraw.Draw(shown), DOT_PX * FINER, self._here
            ahead, nose = radians(heading_deg), NOSE_PX * FINER
            draw.line((x, y, x + nose * sin(ahead), y - nose * cos(ahead)), WHITE, 2 * FINER)
            draw.ellipse((x - dot, y - dot, x + dot, y + dot), WHITE, "black", 2)
        return shown.resize((PICTURE_PX, PICTURE_PX), Image.Resampling.BOX)

    def _draw_forest(self, forest: Forest) -> Image.Image:
        size = FINER * PICTURE_PX
        image = Image.new("RGB", (size, size))
        draw = ImageDraw.Draw(image)
        draw.rounded_rectangle((0, 0, size - 1, size - 1), 6 * FINER, GROUND)
        for trunk, diameter_m in forest.thick_trunks:
            ends = (self._place(trunk.x0_m, trunk.y0_m), self._place(trunk.x1_m, trunk.y1_m))
            draw.line(ends, WOOD, max(round(diameter_m * self._scale), FINER))
        for x_m, y_m in forest.trees_m:
            (x, y), radius = self._place(x_m, y_m), 1.4 * FINER
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), LEAF)
        _, goal = self._place(0.0, forest.goal_y_m)
        draw.line((2 * FINER, goal, size - 2 * FINER, goal), WHITE, FINER)
        return image

    def _place(self, x_m: float, y_m: float) -> tuple[float, float]:
        return x_m * self._scale, (WORLD_SIZE_M - y_m) * self._scale
