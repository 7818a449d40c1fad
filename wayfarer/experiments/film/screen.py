"""OpenGL rendering without a display, by EGL.

``mujoco.Renderer`` would draw with what the variable ``MUJOCO_GL`` said when the engine was imported: without it, on a
screen. Nothing else of wayfarer needs OpenGL, so it is looked for when a film is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import BadInput, kind_and_text
from wayfarer.experiments.film.camera import View
from wayfarer.experiments.film.footage import FilmedTick
from wayfarer.experiments.film.scenery import EARTH, Scenery

INSTALL = "apt install libegl1 libgl1-mesa-dri"
FADED = 0.22  # how much is left of a tree that stands before the rover
FADES_WITHIN_M = 0.35
MARKS_IN_SIGHT_M = 8.0
MOST_MARKS = 10_000  # at a time, the latest: a rover that drives 1,000 m in a pocket leaves 70,000


@contextmanager
def opengl(width: int, height: int) -> Iterator[None]:
    """Have OpenGL draw off screen.

    Raises:
        BadInput: it cannot; the text says what to install.
    """
    try:
        from mujoco.egl import GLContext  # raises where the system has no EGL

        context = GLContext(width, height)
        context.make_current()
    except Exception as error:  # of PyOpenGL, of MuJoCo, or of a library that is half there
        raise BadInput(f"--video cannot draw with OpenGL ({kind_and_text(error)}): {INSTALL}") from error
    try:
        yield
    finally:
        context.free()


class Screen:
    """Draws a scenery; OpenGL must be there until it is closed."""

    def __init__(self, scenery: Scenery, width: int, height: int) -> None:
        self._scenery, self._model = scenery, scenery.model
        self._data, self._option = mujoco.MjData(self._model), mujoco.MjvOption()
        self._scene = mujoco.MjvScene(self._model, maxgeom=self._model.ngeom)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_FOG], self._scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = True, False
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        self._rectangle = mujoco.MjrRect(0, 0, width, height)

    def draw(self, tick: FilmedTick, view: View) -> NDArray[np.uint8]:
        """Return the picture of a moment: rows, columns, red green blue."""
        self._show_marks(tick)
        self._fade_trees(view)
        self._data.qpos[:] = tick.joints
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        camera = mujoco.MjvCamera()
        camera.lookat[:] = view.at_m
        camera.azimuth, camera.elevation, camera.distance = view.azimuth_deg, -view.elevation_deg, view.distance_m
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, camera, everything, self._scene)
        mujoco.mjr_render(self._rectangle, self._scene, self._context)
        pixels = np.empty((self._rectangle.height, self._rectangle.width, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._rectangle, self._context)
        return pixels[::-1]  # OpenGL counts rows from below

    def close(self) -> None:
        """Give back what OpenGL holds for it, while that is still there: freed later, it would be another film's."""
        self._context.free()

    def _show_marks(self, tick: FilmedTick) -> None:
        """Show the marks that tyres have left by now, where they are near; MuJoCo skips what is quite transparent."""
        scenery, model = self._scenery, self._model
        away_m = np.linalg.norm(model.geom_pos[scenery.marks, :2] - tick.joints[:2], axis=1)
        there = np.flatnonzero((scenery.marks_s <= tick.t_s) & (away_m < MARKS_IN_SIGHT_M))
        latest = there[np.argsort(scenery.marks_s[there])[-MOST_MARKS:]]
        model.geom_rgba[scenery.marks, 3] = 0.0
        model.geom_rgba[scenery.marks[latest], 3] = EARTH[3]

    def _fade_trees(self, view: View) -> None:
        """Let the rover be seen through trees between it and the camera."""
        trees, azimuth = self._scenery.trees, np.radians(view.azimuth_deg)
        to_camera = -np.array((np.cos(azimuth), np.sin(azimuth)))
        from_rover_m = self._model.geom_pos[trees, :2] - view.at_m[:2]
        along_m, aside_m = from_rover_m @ to_camera, from_rover_m @ (to_camera[1], -to_camera[0])
        between = (along_m > 0.0) & (along_m < view.distance_m) & (np.abs(aside_m) < FADES_WITHIN_M)
        self._model.geom_rgba[trees, 3] = np.where(between, FADED, 1.0)
