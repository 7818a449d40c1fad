"""Triangle meshes of the film: logs, trees, grass. Each vertex has texture coordinates."""

from __future__ import annotations

from math import pi
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIDES = 20  # of a round trunk
RING_M = 0.25  # between two rings of points along a trunk
TREE_HEIGHT_M = 9.0
LOG_STRETCH = 2.5  # of the texture along a log, so that its patches of moss do not come too often
ROOTS_M = 0.35  # up to which a tree is wider


class Shape(NamedTuple):
    """Points, their places in the texture, and the triangles between them, counter-clockwise seen from outside."""

    points_m: Array
    places: Array
    triangles: NDArray[np.int64]

    def add_to(self, spec: Any, name: str) -> None:
        """Make it a mesh of a model; it is looked at, never touched."""
        spec.add_mesh(
            name=name,
            uservert=self.points_m.ravel(),
            usertexcoord=self.places.ravel(),
            userface=self.triangles.ravel(),
            userfacetexcoord=self.triangles.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )


def together(shapes: list[Shape]) -> Shape:
    """Return several shapes as one."""
    before = np.cumsum([0, *(len(shape.points_m) for shape in shapes[:-1])])
    return Shape(
        np.concatenate([shape.points_m for shape in shapes]),
        np.concatenate([shape.places for shape in shapes]),
        np.concatenate([shape.triangles + first for shape, first in zip(shapes, before, strict=True)]),
    )


def fallen_trunk(start_m: Array, end_m: Array, radius_m: float, rng: Generator) -> Shape:
    """Return a fallen trunk, uneven by a tenth of its radius, with moss on top.

    The texture's left and right edges meet underneath. It ends where the engine's capsule is still as wide as a trunk.
    """
    along = end_m - start_m
    length_m = float(np.linalg.norm(along))
    along /= length_m
    start_m, length_m = start_m - 0.6 * radius_m * along, length_m + 1.2 * radius_m
    across = np.cross((0.0, 0.0, 1.0), along)
    rings = max(round(length_m / RING_M), 2)
    at_m = np.linspace(0.0, length_m, rings + 1)
    turns = np.linspace(0.0, 2.0 * pi, SIDES + 1)
    wide_m = radius_m * (1.0 - 0.1 * _lumps(rng, rings + 1))
    outwards = np.sin(turns)[:, None] * across - np.cos(turns)[:, None] * np.array((0.0, 0.0, 1.0))
    points_m = (start_m + at_m[:, None] * along)[:, None, :] + wide_m[..., None] * outwards
    return _skin(points_m, at_m / (LOG_STRETCH * 2.0 * pi * radius_m) + rng.uniform())


def tree(radius_m: float, rng: Generator) -> Shape:
    """Return a standing trunk around the origin, with its roots' flare; its top is above every picture."""
    at_m = np.array((-0.05, 0.0, 0.06, 0.14, 0.24, ROOTS_M, 0.6, 1.2, 2.0, 3.5, 6.0, TREE_HEIGHT_M))
    turns = np.linspace(0.0, 2.0 * pi, SIDES + 1)
    roots = 1.0 + 0.45 * np.clip(1.0 - at_m / ROOTS_M, 0.0, 1.0)[:, None] ** 2 * (
        1.0 + 0.6 * np.cos(5.0 * turns + rng.uniform(0.0, 2.0 * pi))
    )
    taper = (1.0 - 0.045 * np.clip(at_m, 0.0, None))[:, None]
    wide_m = radius_m * roots * taper * (1.0 - 0.08 * _lumps(rng, len(at_m)))
    lean_m = rng.normal(0.0, 0.012, 2) * np.clip(at_m, 0.0, None)[:, None]
    points_m = np.stack(
        (
            lean_m[:, :1] + wide_m * np.cos(turns),
            lean_m[:, 1:] + wide_m * np.sin(turns),
            np.broadcast_to(at_m[:, None], wide_m.shape),
        ),
        axis=-1,
    )
    return _skin(points_m, at_m / (2.0 * pi * radius_m))


def grass(roots_m: Array, rng: Generator) -> Shape:
    """Return tufts of a few leaning blades each at these places; each blade can be seen from both sides."""
    blades = 7
    turns = rng.uniform(0.0, 2.0 * pi, (len(roots_m), blades))
    high_m = rng.uniform(0.05, 0.13, turns.shape)
    outwards = np.stack((np.cos(turns), np.sin(turns), np.zeros_like(turns)), axis=-1)
    aside = np.stack((-np.sin(turns), np.cos(turns), np.zeros_like(turns)), axis=-1) * 0.008
    foot_m = roots_m[:, None, :] + 0.02 * outwards
    tip_m = foot_m + outwards * high_m[..., None] * 0.6 + high_m[..., None] * np.array((0.0, 0.0, 1.0))
    points_m = np.stack((foot_m - aside, foot_m + aside, tip_m), axis=-2).reshape(-1, 3)
    front = np.arange(len(points_m)).reshape(-1, 3)
    places = np.tile(((0.0, 0.0), (1.0, 0.0), (0.5, 1.0)), (len(front), 1))
    return Shape(points_m, places, np.concatenate((front, front[:, ::-1])))


def _skin(points_m: Array, down: Array) -> Shape:
    """Return the surface through rings of points, closed all round; ``down`` is each ring's place along the texture."""
    rings, sides = points_m.shape[:2]
    number = np.arange(rings * sides).reshape(rings, sides)
    one, right, up, both = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    triangles = np.stack((one, right, both, one, both, up), axis=-1).reshape(-1, 3)
    places = np.stack(np.broadcast_arrays(np.linspace(0.0, 1.0, sides), down[:, None]), axis=-1)
    return Shape(points_m.reshape(-1, 3), places.reshape(-1, 2), triangles)


def _lumps(rng: Generator, rings: int) -> Array:
    """Return unevenness in 0..1 for each point of each ring; the first and last point of a ring are the same."""
    lumps = rng.uniform(size=(rings, SIDES + 1))
    lumps[:, -1] = lumps[:, 0]
    return lumps
