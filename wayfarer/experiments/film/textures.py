"""Textures of the film: soil, leaves, bark, made of seeded noise.

Colours are chosen to look like a forest in autumn; none of this has a source, and nothing of it reaches the trial. Each
picture goes on at its own edges, so that it can be laid side by side.
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.ndimage import fourier_gaussian

Picture = NDArray[np.float64]  # rows, columns, red green blue in 0..1

GROUND_SIZE = 2048
GROUND_M = 9.0  # which the ground's picture covers: 4 mm a pixel
LEAVES = 20_000
LEAF_PX = (4.0, 9.0)  # half the length of a leaf: 4 to 8 cm long
LEAF_KINDS = 64
BARK_SIZE = 512

SOIL_DARK, SOIL_LIGHT = np.array((0.20, 0.15, 0.10)), np.array((0.45, 0.35, 0.24))
MOSS = np.array((0.24, 0.26, 0.12))
LEAF_COLOURS = np.array(
    (
        (0.42, 0.27, 0.13),
        (0.50, 0.33, 0.15),
        (0.36, 0.22, 0.12),
        (0.30, 0.19, 0.11),
        (0.56, 0.42, 0.20),
        (0.46, 0.22, 0.10),
        (0.38, 0.34, 0.14),
    )
)
BARK_DARK, BARK_LIGHT = np.array((0.11, 0.08, 0.06)), np.array((0.43, 0.34, 0.26))
BARK_MOSS = np.array((0.27, 0.30, 0.14))
WOOD = np.array((0.66, 0.52, 0.34))


def clouds(rng: Generator, size: int, rows_px: float, columns_px: float) -> NDArray[np.float64]:
    """Return smooth noise with features of these sizes, mean 0.5, nearly all of it within 0..1."""
    noise = rng.standard_normal((size, size))
    smooth = np.fft.irfft2(fourier_gaussian(np.fft.rfft2(noise), (rows_px / 2.0, columns_px / 2.0), size), (size, size))
    return np.asarray(np.clip(0.5 + smooth / (4.0 * smooth.std()), 0.0, 1.0))


def mix(one: Picture, other: Picture, share: NDArray[np.float64]) -> Picture:
    """Return one colour where ``share`` is 0, and another where it is 1."""
    return one + (other - one) * share[..., None]


def forest_floor(rng: Generator) -> Picture:
    """Return soil with moss, under fallen leaves."""
    size = GROUND_SIZE
    fine = 0.45 * clouds(rng, size, 60, 60) + 0.35 * clouds(rng, size, 10, 10) + 0.2 * clouds(rng, size, 3, 3)
    floor = mix(SOIL_DARK, SOIL_LIGHT, np.clip(2.4 * fine - 0.7, 0.0, 1.0))
    floor = mix(floor, MOSS, 0.6 * np.clip(4.0 * clouds(rng, size, 260, 260) - 2.2, 0.0, 1.0) * (0.4 + fine))
    _lay_leaves(floor, rng)
    light = 0.72 + 0.56 * clouds(rng, size, 330, 330)  # where the sun comes through the leaves above
    return np.clip(floor * light[..., None], 0.0, 1.0)


def _lay_leaves(floor: Picture, rng: Generator) -> None:
    """Lay leaves, each with its shadow and its rib."""
    size = len(floor)
    kinds = [_leaf(rng.uniform(*LEAF_PX), rng.uniform(0.0, pi)) for _ in range(LEAF_KINDS)]
    colours = LEAF_COLOURS[rng.integers(len(LEAF_COLOURS), size=LEAVES)] * rng.uniform(0.55, 1.15, (LEAVES, 1))
    places, which = rng.integers(size, size=(LEAVES, 2)), rng.integers(LEAF_KINDS, size=LEAVES)
    for (row, column), colour, kind in zip(places.tolist(), colours, which.tolist(), strict=True):
        cover, shade = kinds[kind]
        offset = np.arange(len(cover))
        under = np.ix_((row + 2 + offset) % size, (column + 2 + offset) % size)
        floor[under] *= 1.0 - 0.45 * cover
        here = np.ix_((row + offset) % size, (column + offset) % size)
        floor[here] += cover * (shade * colour - floor[here])


def _leaf(half_px: float, turn: float) -> tuple[Picture, Picture]:
    """Return how much of each pixel a leaf covers, and how bright it is there: darker along its rib."""
    reach = int(half_px) + 2
    offset = np.arange(-reach, reach + 1)
    along = cos(turn) * offset[:, None] + sin(turn) * offset
    across = cos(turn) * offset - sin(turn) * offset[:, None]
    half_width = 0.42 * half_px * np.clip(1.0 - (along / half_px) ** 2, 0.0, 1.0)
    cover = np.clip(half_width - np.abs(across) + 0.5, 0.0, 1.0) * (np.abs(along) < half_px)
    return cover[..., None], (1.0 - 0.35 * np.clip(1.2 - np.abs(across), 0.0, 1.0))[..., None]


def bark(rng: Generator, moss: float) -> Picture:
    """Return bark; columns run round the trunk, rows along it, and moss grows at the middle column by that share."""
    size = BARK_SIZE
    ridges = np.abs(2.0 * clouds(rng, size, 70, 9) - 1.0) * 1.3 + 0.5 * clouds(rng, size, 12, 5)
    wood = mix(BARK_DARK, BARK_LIGHT, np.clip(1.4 * ridges - 0.1, 0.0, 1.0))
    top = 0.5 - 0.5 * np.cos(2.0 * pi * np.arange(size) / size)
    grows = np.clip(4.0 * (clouds(rng, size, 45, 90) + 0.6 * top - 0.85), 0.0, 1.0) * moss
    return np.clip(mix(wood, BARK_MOSS * (0.5 + 0.9 * ridges[..., None]), grows), 0.0, 1.0)


def cut_wood(rng: Generator) -> Picture:
    """Return the rings of a trunk's end around the middle of the picture."""
    size = BARK_SIZE
    place = (np.arange(size) + 0.5) / size - 0.5
    radius = np.hypot(place, place[:, None]) + 0.02 * clouds(rng, size, 120, 120)
    return mix(WOOD * 0.6, WOOD, 0.5 + 0.5 * np.sin(radius * 130.0)) * (1.1 - 0.8 * radius[..., None])
