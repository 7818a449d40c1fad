"""The model that the film is drawn from: the trial's trunks, trees and ground. It is never stepped.

It stands beside the model that the engine moves, so that nothing which is only looked at can touch anything.
"""

from __future__ import annotations

from math import pi
from typing import Any

import mujoco
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from wayfarer.experiments.film import shapes, textures
from wayfarer.experiments.film.looks import add_rover
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.world.collision import Obstacle, obstacles_of
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest

Array = NDArray[np.float64]

FIELD_OF_VIEW_DEG = 42.0
HAZE = (0.63, 0.66, 0.60)  # what is far away looks like this
HAZE_FROM_M, HAZE_UNTIL_M = 7.0, 38.0
SHADOW_TEXELS = 2048
SHADOWS_WITHIN_M = 7.0  # of the rover
SUN = np.array((0.72, 0.28, -0.635))  # its rays: low from the west, so that trunks throw long shadows
SUN_AWAY_M = 8.0
TUFTS = 2500
TREE_KINDS = 3
# Beyond the map's edges stand trees that no rover meets, so that the forest does not end there.
OUTSIDE_M = 18.0
OUTSIDE_TREES = 110
TREE = "tree"  # with which the names of all standing trees begin
EXTENT_M = 10.0  # what MuJoCo's own distances of drawing are given in

BOX, MESH = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_MESH
UNTOUCHABLE = {"contype": 0, "conaffinity": 0}


class Scenery:
    """What is to be seen of a trial.

    ``model`` has the joints of the world's model, so that its poses fit; the rest does not move.
    """

    def __init__(self, forest: Forest, world: MujocoWorld, width: int, height: int) -> None:
        self.model = _build(forest, world, width, height)
        names = [self.model.geom(number).name for number in range(self.model.ngeom)]
        self._trees = np.array([number for number, name in enumerate(names) if name.startswith(TREE)], dtype=int)
        self._feet_m = self.model.geom_pos[self._trees, :2]

    def sun_m(self, over_m: Array) -> Array:
        """Return where the sun's shadows are reckoned from, so that they are fine around a place."""
        return over_m - SUN_AWAY_M * SUN

    def trees_before(self, eye_m: Array, rover_m: Array, within_m: float) -> set[int]:
        """Return the trees, as numbers of geoms, that stand so near to the line between eye and rover."""
        along_m = (rover_m - eye_m)[:2]
        share = np.clip((self._feet_m - eye_m[:2]) @ along_m / (along_m @ along_m), 0.0, 1.0)
        off_m = np.linalg.norm(self._feet_m - eye_m[:2] - share[:, None] * along_m, axis=1)
        return set(self._trees[(off_m < within_m) & (share < 1.0)].tolist())


def _build(forest: Forest, world: MujocoWorld, width: int, height: int) -> Any:
    rng = np.random.default_rng(forest.forest)  # the same layout looks the same
    spec = mujoco.MjSpec()
    _set_light(spec, width, height)
    _add_materials(spec, rng)
    _add_ground(spec, world.model)
    obstacles = obstacles_of(forest)
    _add_fallen_trunks(spec, [each for each in obstacles if each.axis_deg is not None], rng)
    _add_trees(spec, forest, rng)
    _add_grass(spec, obstacles, rng)
    add_rover(spec, world.body)
    return spec.compile()


def _set_light(spec: Any, width: int, height: int) -> None:
    visual = spec.visual
    everywhere = getattr(visual, "global")  # a word of Python's
    everywhere.offwidth, everywhere.offheight, everywhere.fovy = width, height, FIELD_OF_VIEW_DEG
    spec.stat.extent, spec.stat.center = EXTENT_M, (WORLD_SIZE_M / 2.0, WORLD_SIZE_M / 2.0, 0.0)
    visual.quality.shadowsize, visual.quality.offsamples = SHADOW_TEXELS, 4
    visual.map.shadowclip = SHADOWS_WITHIN_M / EXTENT_M
    visual.map.znear, visual.map.zfar = 0.02, 8.0
    visual.map.fogstart, visual.map.fogend = HAZE_FROM_M / EXTENT_M, HAZE_UNTIL_M / EXTENT_M
    visual.rgba.fog = (*HAZE, 1.0)
    visual.headlight.ambient = (0.34, 0.36, 0.38)  # of the sky, which is all that shadows get
    visual.headlight.diffuse = visual.headlight.specular = (0.0, 0.0, 0.0)
    lights = (
        (SUN, (1.12, 1.00, 0.80), True),
        (np.array((-0.4, 0.3, -0.85)), (0.30, 0.34, 0.40), False),  # the sky's blue on the other side
    )
    for ray, diffuse, casts in lights:
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=ray,
            diffuse=diffuse,
            specular=diffuse if casts else (0.0, 0.0, 0.0),
            castshadow=casts,
        )


def _add_materials(spec: Any, rng: Generator) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=HAZE,
        rgb2=HAZE,
        width=16,
        height=96,
    )
    pictures = {
        "ground": textures.forest_floor(rng),
        "bark": textures.bark(rng, 0.25),
        "log": textures.bark(rng, 1.0),
        "cut": textures.cut_wood(rng),
    }
    for name, picture in pictures.items():
        _add_material(spec, name, picture)
    for name, rgba, shine, glow in (
        ("grass", (0.33, 0.38, 0.14, 1.0), 0.0, 0.0),
        ("paint", (1.0, 1.0, 1.0, 1.0), 0.25, 0.0),
        ("lamp", (1.0, 1.0, 1.0, 1.0), 0.5, 0.7),
    ):
        spec.add_material(name=name, rgba=rgba, specular=shine, shininess=0.4, emission=glow)


def _add_material(spec: Any, name: str, picture: textures.Picture) -> None:
    rows, columns = picture.shape[:2]
    texture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=columns, height=rows, nchannel=3)
    texture.data = np.round(255.0 * picture).astype(np.uint8).tobytes()
    material = spec.add_material(name=name, specular=0.0, shininess=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    if name == "ground":
        material.texuniform = True
        material.texrepeat = (2.0 / textures.GROUND_M,) * 2  # MuJoCo counts from the middle of a picture


def _add_ground(spec: Any, model: Any) -> None:
    """Add the ground, with the heights of the world's own where it is rough."""
    if not model.nhfield:
        half_m = WORLD_SIZE_M / 2.0
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=(3.0 * half_m, 3.0 * half_m, 1.0),
            pos=(half_m, half_m, 0.0),
            material="ground",
            **UNTOUCHABLE,
        )
        return
    spec.add_hfield(
        name="ground",
        size=model.hfield_size[0],
        nrow=int(model.hfield_nrow[0]),
        ncol=int(model.hfield_ncol[0]),
        userdata=model.hfield_data,
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", pos=model.geom_pos[0], material="ground", **UNTOUCHABLE
    )


def _add_fallen_trunks(spec: Any, trunks: list[Obstacle], rng: Generator) -> None:
    """Add all fallen trunks as one mesh, and the cut at each end."""
    logs = []
    for x0_m, y0_m, x1_m, y1_m, radius_m, _ in trunks:
        ends_m = np.array((x0_m, y0_m, radius_m)), np.array((x1_m, y1_m, radius_m))
        logs.append(shapes.fallen_trunk(*ends_m, radius_m, rng))
        along = (ends_m[1] - ends_m[0]) / np.linalg.norm(ends_m[1] - ends_m[0])
        for end_m, out in ((ends_m[0], -along), (ends_m[1], along)):
            cut_m = end_m + 0.6 * radius_m * out
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CYLINDER,
                fromto=(*(cut_m - 0.01 * out), *(cut_m + 0.004 * out)),
                size=(0.96 * radius_m, 0.0, 0.0),
                material="cut",
                **UNTOUCHABLE,
            )
    if logs:
        shapes.together(logs).add_to(spec, "logs")
        spec.worldbody.add_geom(type=MESH, meshname="logs", material="log", **UNTOUCHABLE)


def _add_trees(spec: Any, forest: Forest, rng: Generator) -> None:
    """Add each tree of the forest, and those beyond its edges."""
    for kind in range(TREE_KINDS):
        shapes.tree(forest.tree_radius_m, rng).add_to(spec, f"{TREE}{kind}")
    around_m = rng.uniform(-OUTSIDE_M, WORLD_SIZE_M + OUTSIDE_M, (OUTSIDE_TREES, 2))
    outside_m = around_m[np.abs(around_m - WORLD_SIZE_M / 2.0).max(axis=1) > WORLD_SIZE_M / 2.0 + 1.5]
    for number, (x_m, y_m) in enumerate([*forest.trees_m, *outside_m.tolist()]):
        turn = rng.uniform(0.0, 2.0 * pi)
        spec.worldbody.add_geom(
            name=f"{TREE}{number}",
            type=MESH,
            meshname=f"{TREE}{number % TREE_KINDS}",
            pos=(x_m, y_m, 0.0),
            quat=(np.cos(turn / 2.0), 0.0, 0.0, np.sin(turn / 2.0)),
            material="bark",
            **UNTOUCHABLE,
        )


def _add_grass(spec: Any, obstacles: list[Obstacle], rng: Generator) -> None:
    """Add tufts of grass where no trunk lies."""
    places_m = rng.uniform(0.0, WORLD_SIZE_M, (TUFTS, 2))
    free = [
        (x_m, y_m, 0.0)
        for x_m, y_m in places_m.tolist()
        if all(
            np.hypot(near_x - x_m, near_y - y_m) > each.radius_m
            for each in obstacles
            for near_x, near_y in [each.nearest(x_m, y_m)]
        )
    ]
    shapes.grass(np.array(free), rng).add_to(spec, "grass")
    spec.worldbody.add_geom(type=MESH, meshname="grass", material="grass", **UNTOUCHABLE)
