"""Triangle meshes of the film: logs, trees, grass. Triangles are counter-clockwise seen from outside."""

from __future__ import annotations

from math import pi
from typing import Any

import mujoco
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIDES = 20  # of a round trunk
TURNS = np.linspace(0.0, 2.0 * pi, SIDES + 1)  # of the points of a ring; the first and the last are one
RING_M = 0.25  # between two rings of points along a log
BEYOND = 0.6  # radii by which a log goes on at both ends: there the engine's capsule is still as wide as a trunk
TREE_HEIGHT_M = 9.0  # above every picture
LOG_STRETCH = 2.5  # of the texture along a log, so that its patches of moss do not come too often
ROOTS_M = 0.35  # up to which a tree is wider
BLADES = 7  # of a tuft of grass


def add_log(spec: Any, name: str, length_m: float, radius_m: float, rng: Generator) -> None:
    """Add a log, uneven by a tenth of its radius, upright from the origin; the texture's edges meet ahead, in x."""
    beyond_m = BEYOND * radius_m
    rings = max(round((length_m + 2.0 * beyond_m) / RING_M), 2) + 1
    at_m = np.linspace(-beyond_m, length_m + beyond_m, rings)
    wide_m = radius_m * (1.0 - 0.1 * _lumps(rng, rings))
    # The place in the texture begins at random: no two logs have the same moss.
    _add_trunk(spec, name, at_m, wide_m, at_m / (LOG_STRETCH * 2.0 * pi * radius_m) + rng.uniform())


def add_tree(spec: Any, name: str, radius_m: float, rng: Generator) -> None:
    """Add a standing trunk around the origin, with its roots' flare."""
    at_m = np.array((-0.05, 0.0, 0.06, 0.14, 0.24, ROOTS_M, 0.6, 1.2, 2.0, 3.5, 6.0, TREE_HEIGHT_M))
    root = 1.0 + 0.6 * np.cos(5.0 * TURNS + rng.uniform(0.0, 2.0 * pi))
    roots = 1.0 + 0.45 * np.clip(1.0 - at_m / ROOTS_M, 0.0, 1.0)[:, None] ** 2 * root
    taper = 1.0 - 0.045 * np.clip(at_m, 0.0, None)[:, None]
    wide_m = radius_m * roots * taper * (1.0 - 0.08 * _lumps(rng, len(at_m)))
    _add_trunk(spec, name, at_m, wide_m, at_m / (2.0 * pi * radius_m))


def add_grass(spec: Any, name: str, roots_m: Array, rng: Generator) -> None:
    """Add tufts of leaning blades at these places; each blade can be seen from both sides."""
    turns = rng.uniform(0.0, 2.0 * pi, (len(roots_m), BLADES))
    high_m = rng.uniform(0.05, 0.13, (len(roots_m), BLADES, 1))
    outwards = np.stack((np.cos(turns), np.sin(turns), np.zeros_like(turns)), axis=-1)
    aside_m = 0.008 * np.stack((-np.sin(turns), np.cos(turns), np.zeros_like(turns)), axis=-1)
    foot_m = np.pad(roots_m, ((0, 0), (0, 1)))[:, None] + 0.02 * outwards
    tip_m = foot_m + high_m * (0.6 * outwards + (0.0, 0.0, 1.0))
    points_m = np.stack((foot_m - aside_m, foot_m + aside_m, tip_m), axis=-2).reshape(-1, 3)
    front = np.arange(len(points_m)).reshape(-1, 3)
    _add_mesh(spec, name, points_m, np.concatenate((front, front[:, ::-1])))


def _lumps(rng: Generator, rings: int) -> Array:
    """Return unevenness in 0..1 for each point of each ring."""
    lumps = rng.uniform(size=(rings, SIDES + 1))
    lumps[:, -1] = lumps[:, 0]
    return lumps


def _add_trunk(spec: Any, name: str, at_m: Array, wide_m: Array, down: Array) -> None:
    """Add the surface of an upright trunk.

    Args:
        spec: the model.
        name: of the mesh.
        at_m: the heights of its rings.
        wide_m: its radius at each point of each ring.
        down: each ring's place along the texture.
    """
    points_m = np.stack(np.broadcast_arrays(wide_m * np.cos(TURNS), wide_m * np.sin(TURNS), at_m[:, None]), axis=-1)
    number = np.arange(wide_m.size).reshape(wide_m.shape)
    one, right, up, both = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    triangles = np.stack((one, right, both, one, both, up), axis=-1)
    places = np.stack(np.broadcast_arrays(TURNS / (2.0 * pi), down[:, None]), axis=-1)
    _add_mesh(spec, name, points_m, triangles, usertexcoord=places.ravel(), userfacetexcoord=triangles.ravel())


def _add_mesh(spec: Any, name: str, points_m: Array, triangles: NDArray[np.int64], **texture: Any) -> None:
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # a blade of grass has no volume
    spec.add_mesh(name=name, uservert=points_m.ravel(), userface=triangles.ravel(), inertia=shell, **texture)
