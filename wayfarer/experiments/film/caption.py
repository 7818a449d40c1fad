"""The caption in each picture: name of the trial, time, phase, path length, and a small map of the path so far."""

from __future__ import annotations

from typing import NamedTuple

from PIL import Image, ImageColor, ImageDraw, ImageFont

from wayfarer.escape.api import Phase
from wayfarer.experiments.film.footage import FilmedTick
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.views import palette

Colour = tuple[int, int, int, int]

SHADE: Colour = (16, 18, 14, 185)
WHITE: Colour = (245, 245, 238, 255)
QUIET: Colour = (205, 205, 192, 255)
WOOD: Colour = (188, 160, 120, 255)
LEAF: Colour = (120, 150, 92, 255)
WAY: Colour = (255, 138, 36, 255)
PHASE_RGB = {Phase(phase): ImageColor.getrgb(colour) for phase, colour in palette.PHASE_COLOURS.items()} | {
    Phase.HALT: QUIET
}
FINER = 3  # the map is drawn so many times larger, for smooth lines
MAP_PER_HEIGHT = 0.31
MARGIN_PER_HEIGHT = 0.03
TEXT_PER_HEIGHT = 0.037


class CaptionText(NamedTuple):
    """What the film says beside the rover's own phases: the title, and how the trial ended."""

    title: str
    end: str


class Caption:
    """Writes into the pictures of one film, in their order."""

    def __init__(self, forest: Forest, words: CaptionText, height: int) -> None:
        self._words = words
        self._margin = round(MARGIN_PER_HEIGHT * height)
        self._text_px = max(round(TEXT_PER_HEIGHT * height), 12)
        self._font = ImageFont.load_default(self._text_px)
        self._small = ImageFont.load_default(0.8 * self._text_px)
        self._map_px = round(MAP_PER_HEIGHT * height)
        self._scale = FINER * self._map_px / WORLD_SIZE_M
        self._map = self._drawn(forest)
        self._last: tuple[float, float] | None = None

    def write(self, picture: Image.Image, shot: FilmedTick, over: bool) -> None:
        """Write what is true at a shot; ``over`` when the trial has ended."""
        draw = ImageDraw.Draw(picture, "RGBA")
        margin = self._margin
        draw.text(
            (margin, margin), self._words.title, WHITE, self._small, stroke_width=2, stroke_fill=(20, 20, 16, 150)
        )
        label = self._words.end if over else shot.phase.value.replace("_", " ").upper()
        self._write_state(draw, picture.height, shot, label)
        here = self._place(*shot.joints[:2].tolist())
        on_map = ImageDraw.Draw(self._map)
        if self._last is not None:
            on_map.line((*self._last, *here), WAY, 2 * FINER)
        self._last = here
        shown = self._map.copy()
        dot = 3.2 * FINER
        ImageDraw.Draw(shown).ellipse(
            (here[0] - dot, here[1] - dot, here[0] + dot, here[1] + dot), WHITE, (0, 0, 0, 255), 2
        )
        small = shown.resize((self._map_px, self._map_px), Image.Resampling.BOX)
        picture.paste(small, (picture.width - margin - self._map_px, margin), small)

    def _write_state(self, draw: ImageDraw.ImageDraw, height: int, shot: FilmedTick, label: str) -> None:
        text_px, margin = self._text_px, self._margin
        minutes, seconds = divmod(int(shot.t_s), 60)
        columns = ((f"{minutes}:{seconds:02d}", 3.0), (label, 7.8), (f"{shot.path_m:.0f} m", 2.6))
        top = height - margin - 2.0 * text_px
        width = text_px * (1.6 + sum(ems for _, ems in columns))
        draw.rounded_rectangle((margin, top, margin + width, top + 2.0 * text_px), 0.5 * text_px, SHADE)
        middle, left = top + text_px, margin + 0.8 * text_px
        for index, (text, ems) in enumerate(columns):
            if index == 1:
                radius = 0.32 * text_px
                spot = (left, middle - radius, left + 2.0 * radius, middle + radius)
                draw.ellipse(spot, WHITE if text == self._words.end else PHASE_RGB[shot.phase])
            draw.text((left + (text_px if index == 1 else 0.0), middle), text, WHITE, self._font, anchor="lm")
            left += ems * text_px

    def _drawn(self, forest: Forest) -> Image.Image:
        """Return the map without the way: trunks, trees, and the line that is to be reached."""
        size = FINER * self._map_px
        image = Image.new("RGBA", (size, size))
        draw = ImageDraw.Draw(image)
        draw.rounded_rectangle((0, 0, size - 1, size - 1), 6 * FINER, SHADE)
        for trunk, diameter_m in forest.thick_trunks:
            ends = (*self._place(trunk.x0_m, trunk.y0_m), *self._place(trunk.x1_m, trunk.y1_m))
            draw.line(ends, WOOD, max(round(diameter_m * self._scale), FINER))
        for x_m, y_m in forest.trees_m:
            (x, y), radius = self._place(x_m, y_m), 1.4 * FINER
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), LEAF)
        _, goal = self._place(0.0, forest.goal_y_m)
        draw.line((2 * FINER, goal, size - 2 * FINER, goal), WHITE, FINER)
        return image

    def _place(self, x_m: float, y_m: float) -> tuple[float, float]:
        return x_m * self._scale, (WORLD_SIZE_M - y_m) * self._scale
