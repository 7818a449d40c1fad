"""Hides from the engine what the body cannot reach: it tests every wheel against every obstacle in every step."""

from __future__ import annotations

from math import hypot, inf
from typing import Any

import numpy as np

from wayfarer.simhal.world.collision import Obstacle
from wayfarer.simhal.world.wheeled_body import WheeledBody

# Obstacles are seen so far beyond the body, and looked for again once it has gone half as far: one as fast as 10 m/s is
# still seen in time, 20 ms later. From no source: with less they are looked for more often, with more fewer are hidden.
BEYOND_BODY_M = 0.4


class Nearby:
    """Lets the engine see the obstacles near a place, and no others; geoms are in the order of ``model.build_spec``."""

    def __init__(self, model: Any, obstacles: list[Obstacle], body: WheeledBody) -> None:
        geoms = slice(1, 1 + len(obstacles))
        self._masks = tuple((mask[geoms], mask[geoms].copy()) for mask in (model.geom_contype, model.geom_conaffinity))
        lines = np.array([obstacle[:4] for obstacle in obstacles], dtype=float).reshape(-1, 2, 2)
        self._from_m, self._along_m = lines[:, 0], lines[:, 1] - lines[:, 0]
        self._length_m2 = np.maximum((self._along_m**2).sum(axis=1), 1e-12)  # a tree is a line of no length
        reach_m = hypot(body.length_m / 2.0, body.width_m / 2.0, body.height_m)  # however it is turned and tilted
        self._near_m = np.array([obstacle.radius_m for obstacle in obstacles]) + reach_m + BEYOND_BODY_M
        self._x_m = self._y_m = inf

    def follow(self, x_m: float, y_m: float) -> None:
        """See what is near the body's place, unless it has hardly moved since."""
        if abs(x_m - self._x_m) + abs(y_m - self._y_m) < BEYOND_BODY_M / 2.0:
            return
        self._x_m, self._y_m = x_m, y_m
        to_body_m = (x_m, y_m) - self._from_m
        share = np.clip((to_body_m * self._along_m).sum(axis=1) / self._length_m2, 0.0, 1.0)
        away_m = np.hypot(*(to_body_m - share[:, None] * self._along_m).T)
        for mask, whole in self._masks:
            mask[:] = np.where(away_m < self._near_m, whole, 0)
