"""The model that a film is drawn from: a copy of the trial's own with looks added, and what it touches hidden.

It is never stepped, so nothing that is only looked at can touch anything.
"""

from __future__ import annotations

from importlib.resources import files
from math import atan2, hypot, pi
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from wayfarer.experiments.film import shapes, textures
from wayfarer.experiments.film.footage import FilmedTick
from wayfarer.experiments.film.rover_looks import add_looks
from wayfarer.simhal.mujoco.model import ROVER
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.world.collision import Obstacle, obstacles_of
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest
from wayfarer.simhal.world.wheeled_body import WheeledBody

SUN = np.array((0.72, 0.28, -0.635))  # its rays: low from the west, so that trunks throw long shadows
SUN_RGB = (1.12, 1.00, 0.80)
SUN_AWAY_M = 8.0  # from the rover: shadows are fine around there
TUFTS = 2500  # of grass
TREE_KINDS, TREE_LEAN = 3, 0.012  # and by how many radians they lean, as a standard deviation
# Beyond the map's edges stand trees that no rover meets, so that the forest does not end there.
OUTSIDE_M, OUTSIDE_TREES = 18.0, 110

# Tyres leave a bar for every two of their lugs.
MARK_EVERY_M, MARK_M = 0.055, 0.036
MARK_ABOVE_M = 0.003  # so that the ground does not cover it
EARTH = (0.075, 0.05, 0.03, 0.42)

HIDDEN_GROUP = 3  # the first that MuJoCo does not draw unless it is asked to
TRIAL = "trial."  # with which the names of the trial's own parts begin

BOX, MESH, CYLINDER = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_CYLINDER


class Scenery(NamedTuple):
    """What is to be seen of a trial.

    ``model`` has the joints of the world's model, so that its poses fit. ``trees`` and ``marks`` are numbers of its
    geoms: the standing trees, and the marks of all tyres, which are left at ``marks_s``.
    """

    model: Any
    trees: NDArray[np.intp]
    marks: NDArray[np.intp]
    marks_s: NDArray[np.float64]


def scenery_of(forest: Forest, world: MujocoWorld, ticks: list[FilmedTick]) -> Scenery:
    """Return what is to be seen of the trial in this forest and world."""
    rng = np.random.default_rng(forest.forest)  # the same layout looks the same
    spec = mujoco.MjSpec.from_string((files(__package__) / "scenery.xml").read_text(encoding="utf-8"))
    trial = world.spec.copy()
    trial.option = spec.option  # of the engine's steps, which are not taken here; MuJoCo warns where they differ
    spec.attach(trial, prefix=TRIAL, frame=spec.worldbody.add_frame())
    for geom in spec.geoms:
        geom.group = HIDDEN_GROUP
    ground, rover = spec.geoms[0], spec.body(TRIAL + ROVER)
    ground.group, ground.material = 0, "ground"
    _add_textures(spec, rng)
    _add_fallen_trunks(spec, [each for each in obstacles_of(forest) if each.axis_deg is not None], rng)
    _add_trees(spec, forest, rng)
    shapes.add_grass(spec, "grass", rng.uniform(0.0, WORLD_SIZE_M, (TUFTS, 2)), rng)
    spec.worldbody.add_geom(type=MESH, meshname="grass", material="grass")
    add_looks(rover, world.body)
    light = {"type": mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, "mode": mujoco.mjtCamLight.mjCAMLIGHT_TRACK}
    rover.add_light(**light, pos=-SUN_AWAY_M * SUN, dir=SUN, diffuse=SUN_RGB, specular=SUN_RGB, castshadow=True)
    marks_s = _add_tyre_marks(spec, ticks, world.body)
    model = spec.compile()
    trees, marks = (np.flatnonzero(model.geom_matid == model.material(name).id) for name in ("bark", "earth"))
    return Scenery(model, trees, marks, marks_s)


def _add_textures(spec: Any, rng: Generator) -> None:
    pictures = {
        "ground": textures.forest_floor(rng),
        "bark": textures.bark(rng, 0.25),
        "log": textures.bark(rng, 1.0),
        "cut": textures.cut_wood(rng),
    }
    for name, picture in pictures.items():
        (rows, columns, _), kind = picture.shape, mujoco.mjtTexture.mjTEXTURE_2D
        texture = spec.add_texture(name=name, type=kind, width=columns, height=rows, nchannel=3)
        texture.data = np.round(255.0 * picture).astype(np.uint8).tobytes()
        spec.material(name).textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    spec.material("ground").texrepeat = (2.0 / textures.GROUND_M,) * 2  # MuJoCo counts from a picture's middle


def _add_fallen_trunks(spec: Any, trunks: list[Obstacle], rng: Generator) -> None:
    """Add each fallen trunk, and the cut at each end."""
    for number, (x0_m, y0_m, x1_m, y1_m, radius_m, _) in enumerate(trunks):
        name, foot_m, length_m = f"log{number}", (x0_m, y0_m, radius_m), hypot(x1_m - x0_m, y1_m - y0_m)
        shapes.add_log(spec, name, length_m, radius_m, rng)
        # From upright to lying along its line: what was ahead, in x, is underneath then, and the moss on top.
        lying = Rotation.from_euler("yz", (pi / 2.0, atan2(y1_m - y0_m, x1_m - x0_m)))
        quat = lying.as_quat(scalar_first=True)
        spec.worldbody.add_geom(type=MESH, meshname=name, material="log", pos=foot_m, quat=quat)
        for at_m in (-shapes.BEYOND * radius_m, length_m + shapes.BEYOND * radius_m):
            end_m, size = foot_m + lying.apply((0.0, 0.0, at_m)), (0.96 * radius_m, 0.005, 0.0)
            spec.worldbody.add_geom(type=CYLINDER, material="cut", pos=end_m, quat=quat, size=size)


def _add_trees(spec: Any, forest: Forest, rng: Generator) -> None:
    """Add each tree of the forest, and those beyond its edges."""
    for kind in range(TREE_KINDS):
        shapes.add_tree(spec, f"tree{kind}", forest.tree_radius_m, rng)
    around_m = rng.uniform(-OUTSIDE_M, WORLD_SIZE_M + OUTSIDE_M, (OUTSIDE_TREES, 2))
    outside_m = around_m[np.abs(around_m - WORLD_SIZE_M / 2.0).max(axis=1) > WORLD_SIZE_M / 2.0 + 1.5]
    for number, (x_m, y_m) in enumerate([*forest.trees_m, *outside_m.tolist()]):
        stands = Rotation.from_euler("xyz", (*rng.normal(0.0, TREE_LEAN, 2), rng.uniform(0.0, 2.0 * pi)))
        # Each tree has a separate colour in place of the material's, so that one tree alone can be made transparent.
        spec.worldbody.add_geom(
            type=MESH, meshname=f"tree{number % TREE_KINDS}", material="bark", rgba=(1.0, 1.0, 1.0, 1.0),
            pos=(x_m, y_m, 0.0), quat=stands.as_quat(scalar_first=True),
        )  # fmt: skip


def _add_tyre_marks(spec: Any, ticks: list[FilmedTick], body: WheeledBody) -> NDArray[np.float64]:
    """Add the bars that four wheels leave in the whole trial; return when they do, in the order of the geoms."""
    times_s = np.array([tick.t_s for tick in ticks])
    joints = np.array([tick.joints for tick in ticks])
    attitudes = Rotation.from_quat(joints[:, 3:7], scalar_first=True)
    half_base_m, half_track_m, radius_m = body.wheels
    size = (MARK_M / 2.0, 0.42 * body.tyre_width_m, 0.001)
    marks_s = []
    for ahead, left in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        foot = (ahead * half_base_m, left * half_track_m, MARK_ABOVE_M - radius_m)
        feet_m = joints[:, :3] + attitudes.apply(foot)
        gone_m = np.cumsum(np.linalg.norm(np.diff(feet_m[:, :2], axis=0, prepend=feet_m[:1, :2]), axis=1))
        left_at = np.unique(np.searchsorted(gone_m, np.arange(MARK_EVERY_M, gone_m[-1], MARK_EVERY_M)))
        for pos, quat in zip(feet_m[left_at], joints[left_at, 3:7], strict=True):
            spec.worldbody.add_geom(type=BOX, pos=pos, quat=quat, size=size, rgba=EARTH, material="earth")
        marks_s.append(times_s[left_at])
    return np.concatenate(marks_s)
