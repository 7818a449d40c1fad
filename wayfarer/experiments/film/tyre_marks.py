"""The tyre tracks behind the rover."""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wayfarer.experiments.film.footage import FilmedTick
from wayfarer.simhal.world.wheeled_body import WheeledBody

Array = NDArray[np.float64]

EVERY_M = 0.055  # from bar to bar, and
BAR_M = 0.036  # how long one is: about what two lugs of a tyre leave
ABOVE_GROUND_M = 0.003  # so that the ground does not cover it
EARTH = np.array((0.075, 0.05, 0.03, 0.42), dtype=np.float32)
IN_SIGHT_M = 8.0


class TyreMarks(NamedTuple):
    """The bars of a whole trial in the order of time: when, where, and how each lies."""

    times_s: Array
    places_m: Array
    turns: Array

    def until(self, t_s: float, near_m: Array) -> NDArray[np.intp]:
        """Return the numbers of the bars that are there at a time, and not far from a place."""
        there = np.searchsorted(self.times_s, t_s, "right")
        return np.flatnonzero(np.linalg.norm(self.places_m[:there, :2] - near_m[:2], axis=1) < IN_SIGHT_M)


def bars_of(shots: list[FilmedTick], body: WheeledBody) -> TyreMarks:
    """Return the bars that four wheels leave."""
    joints = np.array([shot.joints for shot in shots])
    turns = Rotation.from_quat(np.roll(joints[:, 3:7], -1, axis=1)).as_matrix()
    half_base_m, half_track_m, radius_m = body.wheels
    times_s, places_m, lie = [], [], []
    for ahead, left in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        below = np.array((ahead * half_base_m, left * half_track_m, ABOVE_GROUND_M - radius_m))
        feet_m = joints[:, :3] + turns @ below
        gone_m = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(feet_m[:, :2], axis=0), axis=1))))
        moments = np.unique(np.searchsorted(gone_m, np.arange(EVERY_M, gone_m[-1], EVERY_M)))
        times_s += [shots[moment].t_s for moment in moments]
        places_m.append(feet_m[moments])
        lie.append(turns[moments])
    order = np.argsort(times_s, kind="stable")
    return TyreMarks(np.array(times_s)[order], np.concatenate(places_m)[order], np.concatenate(lie)[order])


def add_bars(scene: Any, bars: TyreMarks, numbers: NDArray[np.intp], body: WheeledBody) -> None:
    """Add bars to what is drawn next."""
    size = np.array((BAR_M / 2.0, 0.42 * body.tyre_width_m, 0.001))
    for number in numbers[-(scene.maxgeom - scene.ngeom) :]:
        mujoco.mjv_initGeom(
            scene.geoms[scene.ngeom],
            mujoco.mjtGeom.mjGEOM_BOX.value,
            size,
            bars.places_m[number],
            bars.turns[number].ravel(),
            EARTH,
        )
        scene.ngeom += 1
