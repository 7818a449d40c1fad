"""The ground: height field of rough ground, and mud."""

from __future__ import annotations

from math import ceil, floor, log, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.simhal.world.physics import Physics

# The height field covers the world and this much around it, so that a rover leaves the world first.
MARGIN_M = 2.0
CELL_M = 0.1  # about a wheel's diameter; each halving makes a step of the engine dearer by half
BUMP_M = 0.25  # heights so far apart are hardly alike (correlation 1/e); from no source: about half a rover

# Mud comes in round patches. From no source, chosen to be plain: about the length of a rover each, and so slippery that
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


# So many patches leave 1 % of the ground bare (a Poisson process of discs): more of them change nothing but the time
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
