"""The caption in each picture: name of the trial, time, phase, path length, and a small map of the path so far."""

from __future__ import annotations

from PIL import Image, ImageDraw, ImageFont

from wayfarer.experiments.film.footage import FilmedTick, Footage
from wayfarer.experiments.forest_map import WHITE, ForestMap
from wayfarer.fieldlog.vocabulary import in_words, outcome_in_words
from wayfarer.views import palette

SHADE = (16, 18, 14, 185)
QUIET = (205, 205, 192)
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
        self._map = ForestMap(spec.forest, self._map_px, SHADE)

    def write(self, picture: Image.Image, tick: FilmedTick, over: bool) -> None:
        """Write what is true at a tick; ``over`` when the trial has ended."""
        draw, margin = ImageDraw.Draw(picture, "RGBA"), self._margin
        draw.text((margin, margin), self._title, WHITE, self._small, stroke_width=2, stroke_fill=(20, 20, 16, 150))
        phase = tick.phase.value
        colour = WHITE if over else palette.PHASE_COLOURS.get(phase, QUIET)
        label = outcome_in_words(self._end) if over else in_words(phase)
        self._write_state(draw, picture.height, tick, label, colour)
        self._map.go(*tick.joints[:2].tolist())
        shown = self._map.draw()
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
