"""OpenGL rendering without a display.

Nothing else of wayfarer needs OpenGL, so it is looked for here, when a film is asked for, and not when the engine is
imported.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes.util import find_library
from importlib import import_module

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import BadInput, kind_and_text
from wayfarer.experiments.film.camera import View
from wayfarer.experiments.film.scenery import Scenery

# How MuJoCo can draw off screen, the first the better, and the system library that each needs.
BACKENDS = {"egl": "EGL", "osmesa": "OSMesa"}
INSTALL = "apt install libegl1 libgl1-mesa-dri"
MOST_GEOMS = 12_000
FADED = 0.22  # how much is left of a tree that stands before the rover
FADES_WITHIN_M = 0.35

Image = NDArray[np.uint8]  # rows, columns, red green blue


def backend() -> str:
    """Return how to draw: what ``MUJOCO_GL`` says, or the first that the system has.

    Raises:
        BadInput: there is none; the text says what to install.
    """
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    if asked and asked not in BACKENDS:
        raise BadInput(f"--video draws without a screen, and MUJOCO_GL={asked} cannot: unset it, or set egl or osmesa")
    for name in [asked] if asked else BACKENDS:
        if find_library(BACKENDS[name]):
            return name
    wanted = f"lib{BACKENDS[asked]}, as MUJOCO_GL={asked} asks" if asked else "libEGL or libOSMesa"
    raise BadInput(f"--video draws with OpenGL, and the system has no {wanted}: {INSTALL}")


@contextmanager
def opengl(width: int, height: int) -> Iterator[None]:
    """Have OpenGL draw off screen.

    Raises:
        BadInput: it cannot; the text says what to install.
    """
    name = backend()
    try:
        context = import_module(f"mujoco.{name}").GLContext(width, height)
        context.make_current()
    except Exception as error:  # of PyOpenGL, of MuJoCo, or of a library that is half there
        raise BadInput(f"--video cannot draw with {name} ({kind_and_text(error)}): {INSTALL}") from error
    try:
        yield
    finally:
        context.free()


class Screen:
    """Draws a scenery; OpenGL must be there until it is closed."""

    def __init__(self, scenery: Scenery, width: int, height: int) -> None:
        self._scenery = scenery
        self._model = scenery.model
        self.data = mujoco.MjData(self._model)
        self.scene = mujoco.MjvScene(self._model, maxgeom=MOST_GEOMS)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_FOG):
            self.scene.flags[flag] = True
        self.scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = False
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._rectangle = mujoco.MjrRect(0, 0, width, height)
        self._pixels = np.empty((height, width, 3), np.uint8)

    def place(self, joints: NDArray[np.float64], view: View) -> None:
        """Put the rover and the camera where they are; what else is to be drawn is then added to ``scene``."""
        self.data.qpos[:] = joints
        mujoco.mj_kinematics(self._model, self.data)
        mujoco.mj_camlight(self._model, self.data)
        camera = self._camera
        camera.lookat[:] = view.at_m
        camera.azimuth, camera.elevation, camera.distance = view.azimuth_deg, -view.elevation_deg, view.distance_m
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self.data, self._option, None, camera, everything, self.scene)
        for light in self.scene.lights[: self.scene.nlight]:
            if light.castshadow:
                light.pos[:] = self._scenery.sun_m(joints[:3])
        self._fade(self._scenery.trees_before(view.eye_m, joints[:3], FADES_WITHIN_M))

    def draw(self) -> Image:
        """Return the picture; good until the next one."""
        mujoco.mjr_render(self._rectangle, self.scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, self._rectangle, self._context)
        return self._pixels[::-1]

    def close(self) -> None:
        """Give back what OpenGL holds for it, while that is still there: freed later, it would be another film's."""
        self._context.free()

    def _fade(self, trees: set[int]) -> None:
        """Let the rover be seen through trees."""
        if not trees:
            return
        kind = mujoco.mjtObj.mjOBJ_GEOM
        for geom in self.scene.geoms[: self.scene.ngeom]:
            if geom.objtype == kind and geom.objid in trees:
                geom.rgba[3] = FADED
