"""The caption in each picture: name of the trial, time, phase, path length, and a small map of the path so far."""

from __future__ import annotations

from PIL import Image, ImageDraw, ImageFont

from wayfarer.experiments.film.footage import FilmedTick, Footage
from wayfarer.fieldlog.vocabulary import in_words, outcome_in_words
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.views import palette

SHADE = (16, 18, 14, 185)
WHITE, QUIET = (245, 245, 238), (205, 205, 192)
WOOD, LEAF, WAY = (188, 160, 120), (120, 150, 92), (255, 138, 36)
FINER = 3  # the map is drawn so many times larger, for smooth lines
# Of the picture's height.
MAP, MARGIN, TEXT = 0.31, 0.03, 0.037
SMALLEST_TEXT_PX = 12


class Caption:
    """Writes into the pictures of one film, in their order."""

    def __init__(self, footage: Footage, speed: float, height: int) -> None:
        spec, terrain = footage.spec, footage.world.terrain
        title = f"{spec.rover.name}, {spec.algorithm}, friction {terrain.friction:.2g}"
        self._title = title if speed == 1.0 else f"{title}, {speed:g} x"
        self._end = footage.outcome
        self._margin, self._map_px = round(MARGIN * height), round(MAP * height)
        self._text_px = max(round(TEXT * height), SMALLEST_TEXT_PX)
        self._font, self._small = ImageFont.load_default(self._text_px), ImageFont.load_default(0.8 * self._text_px)
        self._scale = FINER * self._map_px / WORLD_SIZE_M
        self._map = self._draw_map(spec.forest)
        self._way: list[tuple[float, float]] = []

    def write(self, picture: Image.Image, tick: FilmedTick, over: bool) -> None:
        """Write what is true at a tick; ``over`` when the trial has ended."""
        draw, margin = ImageDraw.Draw(picture, "RGBA"), self._margin
        draw.text((margin, margin), self._title, WHITE, self._small, stroke_width=2, stroke_fill=(20, 20, 16, 150))
        phase = tick.phase.value
        colour = WHITE if over else palette.PHASE_COLOURS.get(phase, QUIET)
        label = outcome_in_words(self._end) if over else in_words(phase)
        self._write_state(draw, picture.height, tick, label, colour)
        shown = self._map_at(tick)
        picture.paste(shown, (picture.width - margin - self._map_px, margin), shown)

    def _write_state(
        self, draw: ImageDraw.ImageDraw, height: int, tick: FilmedTick, label: str, colour: str | tuple[int, int, int]
    ) -> None:
        """Write time, phase with a spot of its colour, and path length on a shaded bar."""
        text_px, left = self._text_px, self._margin
        top = height - left - 2.0 * text_px
        middle, radius = top + text_px, 0.32 * text_px
        draw.rounded_rectangle((left, top, left + 18.8 * text_px, top + 2.0 * text_px), 0.5 * text_px, SHADE)
        spot = left + 3.8 * text_px
        draw.ellipse((spot, middle - radius, spot + 2.0 * radius, middle + radius), colour)
        minutes, seconds = divmod(int(tick.t_s), 60)
        for at_ems, text in ((0.8, f"{minutes}:{seconds:02d}"), (4.8, label), (15.2, f"{tick.path_m:.0f} m")):
            draw.text((left + at_ems * text_px, middle), text, WHITE, self._font, anchor="lm")

    def _map_at(self, tick: FilmedTick) -> Image.Image:
        """Return the map with the way so far and where the rover is."""
        x, y = here = self._place(*tick.joints[:2].tolist())
        self._way.append(here)
        ImageDraw.Draw(self._map).line(self._way[-2:], WAY, 2 * FINER)
        shown, dot = self._map.copy(), 3.2 * FINER
        ImageDraw.Draw(shown).ellipse((x - dot, y - dot, x + dot, y + dot), WHITE, "black", 2)
        return shown.resize((self._map_px, self._map_px), Image.Resampling.BOX)

    def _draw_map(self, forest: Forest) -> Image.Image:
        """Return the map without the way: trunks, trees, and the line that is to be reached."""
        size = FINER * self._map_px
        image = Image.new("RGBA", (size, size))
        draw = ImageDraw.Draw(image)
        draw.rounded_rectangle((0, 0, size - 1, size - 1), 6 * FINER, SHADE)
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
