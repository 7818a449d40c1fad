"""The film's camera: it follows behind and beside the rover, above the trunks, with smoothed motion.

The whole path is known before the first picture, so the camera looks ahead as far as it looks back, and lags nowhere.
All its paces are those of the film, however much faster than the trial that runs.
"""

from __future__ import annotations

from math import radians
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from wayfarer.simhal.world.collision import Obstacle

Array = NDArray[np.float64]

# All of these are to the eye's liking.
BESIDE_DEG = 28.0  # from straight behind, so that a side of the rover is seen
ELEVATION_DEG, STEEPEST_DEG = 25.0, 58.0
CLEAR_BY_DEG = 4.0  # above a trunk between camera and rover
LENGTHS_AWAY, LEAST_AWAY_M = 5.3, 1.4  # the distance in lengths of the rover
FOLLOWS_S, TURNS_S, RISES_S = 0.25, 1.3, 0.6
SIGHT_M = np.linspace(0.25, 1.75, 7)  # of the line to the camera, seen from above, where a trunk may hide the rover


class View(NamedTuple):
    """What the camera looks at, and from where: degrees from east to north, and below the horizon."""

    at_m: Array
    azimuth_deg: float
    elevation_deg: float
    distance_m: float


def views(joints: Array, obstacles: list[Obstacle], length_m: float, frames_s: float) -> list[View]:
    """Return the view of each picture.

    Args:
        joints: a row for each picture, the first seven the rover's pose as the engine has it.
        obstacles: what may hide the rover.
        length_m: of the rover.
        frames_s: pictures a second of the film.
    """
    at_m = np.column_stack([smooth(column, FOLLOWS_S * frames_s) for column in joints[:, :3].T])
    w, x, y, z = joints[:, 3:7].T
    yaw = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))  # from east to north
    azimuth = smooth(np.unwrap(yaw), TURNS_S * frames_s) - radians(BESIDE_DEG)
    trunks = [each for each in obstacles if each.axis_deg is not None]
    to_see_over_deg = [_to_see_over_deg(trunk, joints[:, :2], azimuth) for trunk in trunks]
    wanted_deg = np.max([np.full(len(joints), ELEVATION_DEG), *to_see_over_deg], axis=0)
    # The highest of some time before and after: the camera is up before a trunk comes between.
    highest_deg = maximum_filter1d(wanted_deg, 2 * round(2.0 * RISES_S * frames_s) + 1, mode="nearest")
    elevation_deg = smooth(np.minimum(highest_deg, STEEPEST_DEG), RISES_S * frames_s)
    away_m = max(LENGTHS_AWAY * length_m, LEAST_AWAY_M)
    return [View(*view, away_m) for view in zip(at_m, np.degrees(azimuth), elevation_deg, strict=True)]


def smooth(values: Array, frames: float) -> Array:
    """Return values averaged with a bell curve of this standard deviation; its ends are held."""
    return np.asarray(gaussian_filter1d(values, frames, mode="nearest", truncate=3.0))


def _to_see_over_deg(trunk: Obstacle, rover_m: Array, azimuth: Array) -> Array:
    """Return how steeply the camera must look down at each moment, so that a trunk hides nothing of the rover."""
    towards = -np.column_stack((np.cos(azimuth), np.sin(azimuth)))
    places_m = rover_m[:, None] + SIGHT_M[:, None] * towards[:, None]
    foot_m, along_m = np.array(trunk[:2]), np.array(trunk[2:4]) - np.array(trunk[:2])
    share = np.clip((places_m - foot_m) @ along_m / (along_m @ along_m), 0.0, 1.0)
    off_m = np.linalg.norm(places_m - foot_m - share[..., None] * along_m, axis=-1)
    over_deg = np.degrees(np.arctan2(2.0 * trunk.radius_m, SIGHT_M)) + CLEAR_BY_DEG
    return np.asarray(np.where(off_m < trunk.radius_m, over_deg, 0.0).max(axis=1))
