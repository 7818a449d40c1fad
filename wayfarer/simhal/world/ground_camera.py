"""A camera that looks straight down: generates the picture of the ground for the simulated camera.

A texture with detail of all sizes, as leaves, twigs and earth have, that repeats after ``TILE_PX`` pixels: 0.8 m where
a pixel shows 1.5 mm. Chosen by us, to be plain: grey of a shaded forest floor, and the noise of a small
sensor.
"""

from __future__ import annotations

from math import cos, sin
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.drivers.buses import Frame
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import blind_ground, flow_scale
from wayfarer.simhal.world.simulated_world import SimulatedWorld

TILE_PX: Final = 512  # a power of two, so that wrapping is a mask
GREY_MEAN: Final = 110.0
GREY_SD: Final = 35.0
NOISE_SD: Final = 2.0


class GroundCamera:
    """A camera above the middle of the rover, the picture's top ahead.

    ``render`` is what ``buses.FakeBuses.cameras`` wants. ``m_per_pixel`` is the ground that one pixel shows, in
    metres, and also the finest detail of the ground: finer detail would be nothing but noise. Where ``Senses`` have
    blind ground, the picture is black.
    """

    def __init__(self, world: SimulatedWorld, streams: RandomStreams, m_per_pixel: float) -> None:
        self._world = world
        self._px_per_m = flow_scale(world.physics, streams) / m_per_pixel
        self._blind = blind_ground(world, streams)
        self._noise = streams.generator("camera.noise")
        self._ground = texture(streams.generator("camera.ground"))

    def render(self, t_s: float, width: int, height: int) -> Frame:
        """Return what the camera sees at a time: luma of shape (height, width)."""
        self._world.tick_chips()  # a deadman may have tripped since
        self._world.advance_to(t_s)
        is_dark = self._blind is not None and self._blind.is_under()
        seen = 0.0 if is_dark else self._look(width, height)
        grey = seen + NOISE_SD * self._noise.standard_normal((height, width), dtype=np.float32)
        return Frame(t_s, np.clip(np.rint(grey), 0, 255).astype(np.uint8))

    def _look(self, width: int, height: int) -> NDArray[np.float32]:
        """Return the ground under each pixel; columns of the texture run east, its rows north."""
        world = self._world
        right = np.arange(width) - (width - 1) / 2
        ahead = ((height - 1) / 2 - np.arange(height))[:, None]
        sin_h, cos_h = sin(world.heading_rad), cos(world.heading_rad)
        east = world.x_m * self._px_per_m + ahead * sin_h + right * cos_h
        north = world.y_m * self._px_per_m + ahead * cos_h - right * sin_h
        return _between(self._ground, north, east)


def texture(rng: np.random.Generator) -> NDArray[np.float32]:
    """Return a square texture that continues at its opposite edges: noise whose amplitude falls as its detail grows."""
    rows, columns = np.fft.fftfreq(TILE_PX)[:, None], np.fft.rfftfreq(TILE_PX)
    detail = np.hypot(rows, columns)
    detail[0, 0] = np.inf  # no mean
    spectrum = np.fft.rfft2(rng.standard_normal((TILE_PX, TILE_PX))) / detail
    waves = np.fft.irfft2(spectrum, (TILE_PX, TILE_PX))
    ground: NDArray[np.float32] = (GREY_MEAN + waves * (GREY_SD / waves.std())).astype(np.float32)
    return ground


def _between(tile: NDArray[np.float32], rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the texture at points between its own, from the four around each."""
    row, column = np.floor(rows).astype(np.int64), np.floor(columns).astype(np.int64)
    down, along = (rows - row).astype(np.float32), (columns - column).astype(np.float32)
    wrap = TILE_PX - 1
    row, column, row_1, column_1 = row & wrap, column & wrap, (row + 1) & wrap, (column + 1) & wrap
    upper = tile[row, column] * (1 - along) + tile[row, column_1] * along
    lower = tile[row_1, column] * (1 - along) + tile[row_1, column_1] * along
    between: NDArray[np.float32] = upper * (1 - down) + lower * down
    return between
