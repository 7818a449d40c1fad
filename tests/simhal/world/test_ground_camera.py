"""The simulated ground lies still under the camera, and moves as the rover moves."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import radians

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.simhal.clearing import STEADY, VEHICLE, steady_world
from wayfarer.drivers.buses import Frame
from wayfarer.simhal.random_streams import RandomStreams
from wayfarer.simhal.sensor_models import GREY_MEAN, GREY_SD, NOISE_SD, TILE_PX, GroundCamera, flow_scale, texture
from wayfarer.simhal.world.forest import CLEARING
from wayfarer.simhal.world.world import World

M_PER_PIXEL = 0.0015


def world_and_camera(seed: int = 0) -> tuple[World, GroundCamera]:
    world = steady_world(seed=seed)
    return world, GroundCamera(world, RandomStreams(seed), M_PER_PIXEL)


def grey(frame: Frame) -> NDArray[np.float64]:
    return frame.luma.astype(np.float64)


def test_texture_continues_at_its_edges() -> None:
    ground = texture(RandomStreams(0).generator("camera.ground"))
    assert ground.shape == (TILE_PX, TILE_PX)
    assert float(ground.mean()) == pytest.approx(GREY_MEAN, abs=0.1)
    assert float(ground.std()) == pytest.approx(GREY_SD, rel=0.01)
    for edges in (ground[[-1, 0]], ground[:, [-1, 0]].T):
        inside = np.abs(np.diff(ground, axis=0)).mean()
        assert np.abs(np.diff(edges, axis=0)).mean() == pytest.approx(inside, rel=0.3)


def test_standing_still_changes_nothing_but_the_noise() -> None:
    world, camera = world_and_camera()
    frame = camera.render(0.23, 160, 120)
    assert (frame.t_s, frame.luma.shape, frame.luma.dtype.name) == (0.23, (120, 160), "uint8")
    assert world.t_s == pytest.approx(0.2)
    frames = [grey(camera.render(0.25 + 0.05 * k, 160, 120)) for k in range(5)]
    for before, after in pairwise(frames):
        assert np.std(after - before) == pytest.approx(NOISE_SD * 2**0.5, rel=0.1)


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 200.0])
def test_driving_ahead_moves_the_picture_down(heading_deg: float) -> None:
    world, camera = world_and_camera()
    world.heading_rad = radians(heading_deg)
    before = grey(camera.render(0.0, 160, 120))
    steps_px = 20
    world.x_m += steps_px * M_PER_PIXEL * np.sin(world.heading_rad)
    world.y_m += steps_px * M_PER_PIXEL * np.cos(world.heading_rad)
    after = grey(camera.render(0.0, 160, 120))
    assert np.abs(after[steps_px:] - before[:-steps_px]).mean() < 3 * NOISE_SD
    assert np.abs(after - before).mean() > 10 * NOISE_SD


def test_camera_that_is_lower_than_believed_sees_the_ground_pass_faster() -> None:
    physics = replace(STEADY, flow_scale_sd=0.3)
    world = World(CLEARING, VEHICLE, physics, RandomStreams(2))
    camera, scale = GroundCamera(world, RandomStreams(2), M_PER_PIXEL), flow_scale(physics, RandomStreams(2))
    assert scale > 1.3
    before = grey(camera.render(0.0, 160, 120))
    world.y_m += 20 * M_PER_PIXEL / scale
    after = grey(camera.render(0.0, 160, 120))
    assert np.abs(after[20:] - before[:-20]).mean() < 3 * NOISE_SD


def test_turning_right_turns_the_picture_left_about_its_middle() -> None:
    world, camera = world_and_camera()
    before = grey(camera.render(0.0, 120, 120))
    world.heading_rad += radians(90.0)
    after = grey(camera.render(0.0, 120, 120))
    assert np.abs(after - np.rot90(before)).mean() < 3 * NOISE_SD


def test_the_same_seed_gives_the_same_pictures_and_another_seed_others() -> None:
    pictures = [grey(world_and_camera(seed)[1].render(0.0, 64, 48)) for seed in (1, 1, 2)]
    assert (pictures[0] == pictures[1]).all()
    assert np.abs(pictures[0] - pictures[2]).mean() > 10 * NOISE_SD


def test_ground_is_the_same_where_the_rover_comes_back_to() -> None:
    world, camera = world_and_camera()
    before = grey(camera.render(0.0, 64, 48))
    world.x_m += 3 * TILE_PX * M_PER_PIXEL  # the tile repeats, so this is the same place too
    world.y_m -= 7 * TILE_PX * M_PER_PIXEL
    assert np.abs(grey(camera.render(0.0, 64, 48)) - before).mean() < 2 * NOISE_SD
