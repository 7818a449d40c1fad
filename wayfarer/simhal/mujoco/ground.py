"""The ground: height field of rough ground, and mud; and what of the forest the body can reach."""

from __future__ import annotations

from math import ceil, floor, hypot, inf, log, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.collision import Obstacle
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.simhal.world.physics import Physics
from wayfarer.simhal.world.wheeled_body import WheeledBody

# -- what is near ----------------------------------------------------------------------------------------------------
# Hides from the engine what the body cannot reach: it tests every wheel against every obstacle in every step.

# Obstacles are seen so far beyond the body, and looked for again once it has gone half as far: one as fast as 10 m/s is
# still seen in time, 20 ms later. Chosen by us: with less they are looked for more often, with more fewer are hidden.
BEYOND_BODY_M = 0.4


class Nearby:
    """Lets the engine see the obstacles near a place, and no others; geoms are in the order of ``model.build_spec``."""

    def __init__(self, model: Any, obstacles: list[Obstacle], body: WheeledBody) -> None:
        geoms = slice(1, 1 + len(obstacles))
        self._masks = tuple((mask[geoms], mask[geoms].copy()) for mask in (model.geom_contype, model.geom_conaffinity))
        lines = np.array([(it.x0_m, it.y0_m, it.x1_m, it.y1_m) for it in obstacles], dtype=float).reshape(-1, 2, 2)
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


# The height field covers the world and this much around it, so that a rover leaves the world first.
MARGIN_M = 2.0
CELL_M = 0.1  # about a wheel's diameter; each halving makes a step of the engine dearer by half
BUMP_M = 0.25  # heights so far apart are hardly alike (correlation 1/e); chosen by us: about half a rover

# Mud comes in round patches. Chosen by us, to be plain: about the length of a rover each, and so slippery that
# wheels spin at half of full duty.
MUD_RADIUS_M = 0.5
MUD_FRICTION = 0.1
MUD_CELL_M = 0.1


class HeightField(NamedTuple):
    """Heights in metres on a square grid around the middle of the world; rows run north, columns east."""

    heights_m: NDArray[np.float64]
    half_size_m: float

    def top_m(self, x_m: float, y_m: float, reach_m: float) -> float:
        """Return the height of the highest point within reach of a place."""
        centre_m = WORLD_SIZE_M / 2.0
        first, last = (
            [int((at_m + sign * reach_m - centre_m + self.half_size_m) / CELL_M) for at_m in (y_m, x_m)]
            for sign in (-1, 1)
        )
        return float(self.heights_m[first[0] : last[0] + 2, first[1] : last[1] + 2].max())


def rough_ground(roughness_m: float, streams: RandomStreams) -> HeightField:
    """Return ground whose height has this standard deviation: white noise, smoothed over ``BUMP_M``."""
    half_size_m = WORLD_SIZE_M / 2.0 + MARGIN_M
    size = round(2.0 * half_size_m / CELL_M) + 1
    noise = streams.generator("world.heights").standard_normal((size, size))
    per_m = np.hypot(np.fft.fftfreq(size, CELL_M)[:, None], np.fft.rfftfreq(size, CELL_M))
    heights_m = np.fft.irfft2(np.fft.rfft2(noise) * np.exp(-((pi * BUMP_M * per_m) ** 2) / 2.0), (size, size))
    return HeightField(heights_m * (roughness_m / heights_m.std()), half_size_m)


# So many patches leave 1 % of the ground bare (a Poisson process of discs): more of them change only the time
# that they take. ForestRover then meets one every 0.12 m; a shorter ``Physics.slip_mean_m`` gives the same ground.
MOST_PATCHES = -log(0.01) * WORLD_SIZE_M**2 / (pi * MUD_RADIUS_M**2)


class Mud:
    """Where mud lies: as often as a straight way meets it every ``Physics.slip_mean_m``, and not at the start.

    It cannot be met more often than where 99 % of the ground are mud.
    """

    def __init__(self, forest: Forest, physics: Physics, width_m: float, streams: RandomStreams) -> None:
        self._side = round(WORLD_SIZE_M / MUD_CELL_M)
        self._cells = bytearray(self._side * self._side)
        self.anywhere = False
        rng = streams.generator("world.mud")
        met_within_m = 2.0 * MUD_RADIUS_M + width_m
        patches = rng.poisson(min(WORLD_SIZE_M**2 / (met_within_m * physics.slip_mean_m), MOST_PATCHES))
        start_x_m, start_y_m = forest.start_m
        for x_m, y_m in rng.uniform(0.0, WORLD_SIZE_M, (patches, 2)).tolist():
            if (x_m - start_x_m) ** 2 + (y_m - start_y_m) ** 2 > (physics.slip_free_m + met_within_m) ** 2:
                self.add_patch(x_m, y_m)

    def add_patch(self, x_m: float, y_m: float) -> None:
        """Add a patch: row by row, the cells whose middles are in it."""
        self.anywhere = True
        rows = _middles_within(y_m, MUD_RADIUS_M, self._side)
        for row in rows:
            half_chord_m = sqrt(max(MUD_RADIUS_M**2 - ((row + 0.5) * MUD_CELL_M - y_m) ** 2, 0.0))
            columns = _middles_within(x_m, half_chord_m, self._side)
            first = row * self._side + columns.start
            self._cells[first : first + len(columns)] = b"\1" * len(columns)

    def is_muddy(self, x_m: float, y_m: float) -> bool:
        """Return whether there is mud at a point."""
        column, row = int(x_m / MUD_CELL_M), int(y_m / MUD_CELL_M)
        return 0 <= column < self._side and 0 <= row < self._side and bool(self._cells[row * self._side + column])


def _middles_within(at_m: float, reach_m: float, side: int) -> range:
    """Return which of so many cells in a line have their middle within reach of a place."""
    first, last = ceil((at_m - reach_m) / MUD_CELL_M - 0.5), floor((at_m + reach_m) / MUD_CELL_M - 0.5)
    return range(max(first, 0), max(min(last, side - 1), first - 1) + 1)


class WheelFriction:
    """Gives each wheel the friction of what is under it; ``first`` is the first of the four wheels' geoms."""

    def __init__(self, model: Any, data: Any, mud: Mud, first: int, friction: float) -> None:
        self._model = model
        self._places = data.geom_xpos[first : first + 4]  # a view, as long as the data live
        self._mud = mud
        self._first = first
        self._friction = {False: friction, True: min(MUD_FRICTION, friction)}
        self._muddy = [False] * 4

    def update(self) -> None:
        """Look under each wheel."""
        is_muddy = self._mud.is_muddy
        for wheel, (x_m, y_m, _) in enumerate(self._places.tolist()):
            muddy = is_muddy(x_m, y_m)
            if muddy is not self._muddy[wheel]:
                self._muddy[wheel] = muddy
                self._model.geom_friction[self._first + wheel, 0] = self._friction[muddy]
